// SPDX-License-Identifier: Apache-2.0
// The database ends, crashes or is cut off while the store works: what was acknowledged is there,
// once, and the store goes on by itself.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "server/store/postgresql/postgres_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::lost_connection_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::PostgresCluster;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::WaitFor;
using ::testing::HasSubstr;

constexpr uint32_t kBatchRows = 20;

class LostConnection : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresCluster::Installed()) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
    cluster_ = std::make_unique<PostgresCluster>(PostgresCluster::Options{});  // fsync is on
    database_ = cluster_->CreateDatabase();
    ASSERT_OK_AND_ASSIGN(store_,
                         PostgresStore::Open({.url = cluster_->Url(database_), .writer = {}}));
    ASSERT_THAT(store_->CreateSession(CapturingSession({"a"})), IsOk());
  }

  // The next rows of camera a; durable_seq_ is what was acknowledged.
  absl::Status AppendNext() {
    const Delivery delivery =
        MakeDelivery(MakeBatch(KeyOf("a"), durable_seq_ + 1, durable_seq_ + kBatchRows));
    const auto outcomes = store_->Append({&delivery, 1});
    if (outcomes.ok()) durable_seq_ = outcomes->front().durable_seq;
    return outcomes.status();
  }
  // Everything acknowledged is there, each row once, and the counts agree.
  void ExpectWhatWasAcknowledged() {
    uint32_t last = 0;
    for (const auto& [key, row] : ReadRows(*store_)) ASSERT_EQ(std::get<2>(key), ++last);
    EXPECT_EQ(last, durable_seq_);
    ASSERT_OK_AND_ASSIGN(const auto counts, store_->GetSessionCounts("s-test"));
    EXPECT_EQ(counts.at(0).observation_count, durable_seq_);
    ASSERT_OK_AND_ASSIGN(const DatabaseReport report,
                         CheckPostgresDatabase(cluster_->Url(database_), [](double) {}));
    EXPECT_EQ(report.fault_count, 0u) << report.faults.front();
    EXPECT_EQ(report.observation_count, durable_seq_);
  }
  void EndConnections() {
    cluster_->Sql("postgres",
                  "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE "
                  "application_name='rigcal-server'");
  }

  std::unique_ptr<PostgresCluster> cluster_;
  std::string database_;
  std::unique_ptr<PostgresStore> store_;
  uint32_t durable_seq_ = 0;
};

TEST_F(LostConnection, IsMadeAgainWithinTheNextCall) {
  ASSERT_THAT(AppendNext(), IsOk());
  EndConnections();
  EXPECT_THAT(AppendNext(), IsOk());
  EndConnections();
  EXPECT_THAT(store_->GetSession("s-test"), IsOk());
  EXPECT_EQ(store_->Health().problem, "");
  ExpectWhatWasAcknowledged();
}

TEST_F(LostConnection, AnswersUnavailableWhileTheDatabaseIsDown) {
  ASSERT_THAT(AppendNext(), IsOk());
  cluster_->Stop();
  EXPECT_THAT(AppendNext(), StatusIs(absl::StatusCode::kUnavailable, HasSubstr(database_)));
  EXPECT_THAT(store_->GetSession("s-test"), StatusIs(absl::StatusCode::kUnavailable, ::testing::_));
  EXPECT_NE(store_->Health().problem, "");
  cluster_->Start();
  // By itself, with no call that needs it.
  EXPECT_TRUE(WaitFor([&] { return store_->Health().problem.empty(); }));
  EXPECT_THAT(AppendNext(), IsOk());
  ExpectWhatWasAcknowledged();
}

TEST_F(LostConnection, LosesNothingWhenTheDatabaseCrashesAgainAndAgain) {
  std::atomic<bool> end = false;
  std::thread writer([&] {
    while (!end) {
      const absl::Status status = AppendNext();
      if (!status.ok()) {
        EXPECT_THAT(status, StatusIs(absl::StatusCode::kUnavailable, ::testing::_));
        ::rigcal::testing::SleepBriefly();
      }
    }
  });
  for (int crash = 0; crash < 3; ++crash) {
    const uint32_t before = durable_seq_;
    WaitFor([&] { return durable_seq_ > before + 5 * kBatchRows; });
    cluster_->StopAtOnce();
    cluster_->Start();
  }
  const uint32_t before = durable_seq_;
  WaitFor([&] { return durable_seq_ > before + 5 * kBatchRows; });
  end = true;
  writer.join();
  ExpectWhatWasAcknowledged();
}

// The server has committed, and its answer is lost: a trigger at the commit ends the connection
// when the transaction is durable, or before that.
TEST_F(LostConnection, SettlesACommitThatNobodyAnswered) {
  ASSERT_THAT(AppendNext(), IsOk());
  // Deferred: runs within COMMIT. The sequence keeps its value over a rollback: only the first
  // commit fails.
  cluster_->Sql(database_,
                "CREATE SEQUENCE attempt; "
                "CREATE FUNCTION cut() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN "
                "IF nextval('attempt') = 1 THEN PERFORM pg_terminate_backend(pg_backend_pid()); "
                "PERFORM pg_sleep(1); END IF; RETURN NULL; END $$; "
                "CREATE CONSTRAINT TRIGGER cut AFTER INSERT ON batch DEFERRABLE INITIALLY DEFERRED "
                "FOR EACH ROW EXECUTE FUNCTION cut()");
  EXPECT_THAT(AppendNext(), IsOk());
  EXPECT_EQ(durable_seq_, 2 * kBatchRows);
  EXPECT_EQ(cluster_->Sql(database_, "SELECT last_value FROM attempt"), "2") << "it was run again";
  ExpectWhatWasAcknowledged();
}

TEST_F(LostConnection, WritesNothingMoreWhenAnotherServerHasTakenOver) {
  ASSERT_THAT(AppendNext(), IsOk());
  // As a server does that opens the database while this one is cut off.
  cluster_->Sql(database_, "UPDATE writer SET owner=owner+1");
  const uint32_t before = durable_seq_;
  EXPECT_THAT(AppendNext(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                     HasSubstr("another rigcal-server has taken")));
  EXPECT_THAT(store_->CreateSession(CapturingSession({"b"})),
              StatusIs(absl::StatusCode::kFailedPrecondition, ::testing::_));
  EXPECT_NE(store_->Health().problem, "");
  EXPECT_EQ(ReadRows(*store_).size(), before);
}

}  // namespace
}  // namespace rigcal::server::lost_connection_test
