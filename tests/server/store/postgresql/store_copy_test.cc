// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "server/store/factory/open_store.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_copy_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::PostgresCluster;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr StoreOptions kOptions = {.min_free_bytes = 0, .unsafe = true};

Session SessionOf(const std::string& id) {
  Session session = CapturingSession({"a"});
  session.id = id;
  return session;
}

Calibration CalibrationOf(const std::string& session_id) {
  Calibration calibration;
  calibration.rig = "rig";
  calibration.session_ids = {session_id};
  return calibration;
}

class StoreCopy : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PostgresCluster::Installed()) {
      GTEST_SKIP() << "no PostgreSQL server in /usr/lib/postgresql: install the package postgresql";
    }
  }
  std::string Folder(const std::string& name) const { return (directory_.path() / name).string(); }

  const ::rigcal::testing::TemporaryDirectory directory_;
};

TEST_F(StoreCopy, MovesEverythingThereAndBack) {
  const std::string url = PostgresCluster::Shared().NewUrl();
  std::string id, counts;
  size_t rows = 0;
  {
    ASSERT_OK_AND_ASSIGN(const auto store, OpenStore(Folder("from"), kOptions));
    ASSERT_THAT(store->CreateSession(CapturingSession({"a", "b"})), IsOk());
    ASSERT_THAT(store->CreateSession(SessionOf("")), IsOk());
    ASSERT_THAT(store->DeleteSession("s-000001"), IsOk());
    std::vector<Delivery> deliveries;
    for (uint32_t i = 0; i < 100; ++i) {  // more than are read at once
      deliveries.push_back(MakeDelivery(MakeBatch(KeyOf("a"), 1 + 5 * i, 5 + 5 * i)));
    }
    Delivery early = MakeDelivery(MakeBatch(KeyOf("b", 2), 7, 9));
    early.batch.clock_samples = {{.device_ns = 1, .host_monotonic_ns = 2, .host_utc_ns = 3}};
    early.batch.dropped = {{.first_seq = 20, .count = 3, .reason = RefusalReason::kSpoolFreed}};
    deliveries.push_back(early);
    deliveries.push_back(EndDelivery(KeyOf("a"), 500));
    ASSERT_THAT(store->Append(deliveries), IsOk());
    ASSERT_THAT(store->CreateCalibration(CalibrationOf("s-test")), IsOk());
    id = store->server_id();
    counts = CountsText(*store);
    rows = ReadRows(*store).size();
    ASSERT_EQ(rows, 503u);
  }
  ASSERT_OK_AND_ASSIGN(const auto there, CopyStore(Folder("from"), url, kOptions));
  ASSERT_OK_AND_ASSIGN(const auto back, CopyStore(url, Folder("to"), kOptions));
  for (size_t i = 0; i < there.size(); ++i) {
    EXPECT_EQ(there[i].rows, back[i].rows);
    EXPECT_EQ(there[i].digest, back[i].digest) << there[i].name;
  }
  for (const std::string& location : {url, Folder("to")}) {
    ASSERT_OK_AND_ASSIGN(const auto store, OpenStore(location, kOptions));
    EXPECT_EQ(store->server_id(), id);
    EXPECT_EQ(CountsText(*store), counts);
    EXPECT_EQ(ReadRows(*store).size(), rows);
    // Numbers go on where they were.
    ASSERT_OK_AND_ASSIGN(const Session next, store->CreateSession(SessionOf("")));
    EXPECT_EQ(next.id, "s-000002");
    ASSERT_OK_AND_ASSIGN(const Calibration later,
                         store->CreateCalibration(CalibrationOf("s-test")));
    EXPECT_EQ(later.id, "c-000002");
    const Delivery more = MakeDelivery(MakeBatch(KeyOf("b", 3), 1, 4));
    EXPECT_THAT(store->Append({&more, 1}), IsOk());
  }
}

TEST_F(StoreCopy, RefusesADestinationThatIsNotEmptyAndLeavesItAlone) {
  const std::string url = PostgresCluster::Shared().NewUrl();
  {
    ASSERT_OK_AND_ASSIGN(const auto source, OpenStore(Folder("from"), kOptions));
    ASSERT_THAT(source->CreateSession(CapturingSession({"a"})), IsOk());
    ASSERT_OK_AND_ASSIGN(const auto store, OpenStore(url, kOptions));
    ASSERT_THAT(store->CreateSession(SessionOf("mine")), IsOk());
  }
  EXPECT_THAT(CopyStore(Folder("from"), url, kOptions),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not empty")));
  ASSERT_OK_AND_ASSIGN(const auto store, OpenStore(url, kOptions));
  EXPECT_THAT(store->GetSession("mine"), IsOk());
  EXPECT_THAT(store->GetSession("s-test"), StatusIs(absl::StatusCode::kNotFound, ::testing::_));
}

TEST_F(StoreCopy, NamesASourceThatIsNotThere) {
  EXPECT_THAT(CopyStore(Folder("nothing"), Folder("to"), kOptions),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("nothing")));
}

}  // namespace
}  // namespace rigcal::server::store_copy_test
