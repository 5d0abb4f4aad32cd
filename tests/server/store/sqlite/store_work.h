// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <tuple>

#include "server/store/sqlite/database_check.h"
#include "server/store/sqlite/sqlite_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {

// What a client of the store knows for sure.
struct Acknowledged {
  bool session = false;      // s-test exists
  uint32_t durable_seq = 0;  // of its camera a
  int change = -1;           // its title is "after" this number
  bool calibration = false;  // c-000001 exists
  bool deleted = false;      // session "old" is gone
};

// Every kind of write, several checkpoints among them, until one fails or all are done.
class StoreWork {
 public:
  static constexpr int kBatches = 20;
  static constexpr uint32_t kBatchRows = 40;

  explicit StoreWork(server::Store* store, Acknowledged done = {}) : store_(*store), done_(done) {}

  const Acknowledged& done() const { return done_; }
  absl::Status failure() const { return failure_; }

  void Run() {
    if (!Note(store_.CreateSession(CapturingSession({"a"})).status())) return;
    done_.session = true;
    Session old = CapturingSession({"a"});
    old.id = "old";
    if (!Note(store_.CreateSession(old).status())) return;
    for (int batch = 0; batch < kBatches; ++batch) {
      if (!Append()) return;
      if (batch % 5 == 4 && !ChangeSession(batch)) return;
      if (batch == 7) {
        Calibration calibration;
        calibration.rig = "rig";
        if (!Note(store_.CreateCalibration(calibration).status())) return;
        done_.calibration = true;
      }
      if (batch == 12) {
        if (!Note(store_.DeleteSession("old"))) return;
        done_.deleted = true;
      }
    }
  }

  bool Append() {
    const uint32_t first = done_.durable_seq + 1;
    const server::Delivery delivery =
        MakeDelivery(MakeBatch(KeyOf("a"), first, first + kBatchRows - 1));
    const auto outcomes = store_.Append({&delivery, 1});
    if (!Note(outcomes.status())) return false;
    done_.durable_seq = outcomes->front().durable_seq;
    return true;
  }

 private:
  bool ChangeSession(int batch) {
    Session session = CapturingSession({"a"});
    session.title = "after " + std::to_string(batch);
    if (!Note(store_.UpdateSession(session))) return false;
    done_.change = batch;
    return true;
  }
  bool Note(const absl::Status& status) {
    failure_ = status;
    return status.ok();
  }

  server::Store& store_;
  Acknowledged done_;
  absl::Status failure_;
};

// The store in `folder`, opened anew, has all that was acknowledged, each row once, no part of a
// transaction, and nothing damaged; and it goes on.
inline void ExpectAcknowledged(const server::SqliteStoreOptions& options,
                               const Acknowledged& done) {
  ASSERT_OK_AND_ASSIGN(const auto store, server::SqliteStore::Open(options));
  const auto session = store->GetSession("s-test");
  ASSERT_EQ(session.ok() || !done.session, true) << session.status();
  if (!session.ok()) return;
  uint32_t last = 0;
  for (const auto& [key, row] : ReadRows(*store)) ASSERT_EQ(std::get<2>(key), ++last);
  EXPECT_GE(last, done.durable_seq);
  EXPECT_LE(last, done.durable_seq + StoreWork::kBatchRows);
  EXPECT_EQ(last % StoreWork::kBatchRows, 0u) << "part of a transaction";
  EXPECT_EQ(store->GetSessionCounts("s-test")->at(0).observation_count, last);
  if (done.change >= 0) {
    ASSERT_EQ(session->title.substr(0, 6), "after ");
    EXPECT_GE(std::stoi(session->title.substr(6)), done.change);
  }
  if (done.calibration) {
    EXPECT_THAT(store->GetCalibration("c-000001"), IsOk());
  }
  if (done.deleted) {
    EXPECT_FALSE(store->GetSession("old").ok());
  }
  ASSERT_OK_AND_ASSIGN(const server::DatabaseReport report,
                       server::CheckDatabase(options.data_directory / "rigcal.db", [](double) {}));
  EXPECT_EQ(report.fault_count, 0u) << report.faults.front();
  const server::Delivery next = MakeDelivery(MakeBatch(KeyOf("a"), 1, last + 5));
  ASSERT_OK_AND_ASSIGN(const auto outcomes, store->Append({&next, 1}));
  EXPECT_EQ(outcomes[0].stored_rows, 5u);
  EXPECT_EQ(outcomes[0].duplicate_rows, last);
}

}  // namespace rigcal::testing
