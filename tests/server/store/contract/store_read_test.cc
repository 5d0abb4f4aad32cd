// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_read_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

class StoreRead : public ::rigcal::testing::StoreContract {
 protected:
  void SetUp() override {
    StoreContract::SetUp();
    ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
  }
};

TEST_P(StoreRead, ReadsMoreThanOneChunkInOrder) {
  std::vector<Delivery> deliveries;
  for (uint32_t i = 0; i < 600; ++i) {
    deliveries.push_back(MakeDelivery(MakeBatch(KeyOf("b", 2), 1 + 2 * i, 2 + 2 * i)));
    deliveries.push_back(MakeDelivery(MakeBatch(KeyOf("a"), 1 + 2 * i, 2 + 2 * i)));
    deliveries.push_back(MakeDelivery(MakeBatch(KeyOf("b", 1), 1 + 2 * i, 2 + 2 * i)));
  }
  ASSERT_THAT(store().Append(deliveries), IsOk());
  EXPECT_EQ(ReadRows(store()).size(), 3600u);  // which fails where the order is wrong
}

TEST_P(StoreRead, ReadsOneCamera) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  Append(MakeBatch(KeyOf("b"), 1, 7));
  size_t rows = 0;
  const auto count = [&](StoredBatch stored) {
    EXPECT_EQ(stored.batch.stream.camera, "b");
    rows += stored.batch.rows();
    return absl::OkStatus();
  };
  ASSERT_THAT(store().ReadObservations("s-test", "b", count), IsOk());
  EXPECT_EQ(rows, 7u);
  EXPECT_THAT(store().ReadObservations("s-test", "c", count),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("camera c")));
}

TEST_P(StoreRead, StopsAtTheFirstErrorOfTheVisitor) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  Append(MakeBatch(KeyOf("a"), 6, 9));
  int visits = 0;
  const auto visit = [&](StoredBatch) {
    ++visits;
    return absl::CancelledError("enough");
  };
  EXPECT_THAT(store().ReadObservations("s-test", "", visit),
              StatusIs(absl::StatusCode::kCancelled, "enough"));
  EXPECT_EQ(visits, 1);
}

TEST_P(StoreRead, LetsTheVisitorUseTheStore) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  const auto visit = [&](StoredBatch) {
    Append(MakeBatch(KeyOf("b"), 1, 5));
    return store().GetStream(KeyOf("a")).status();
  };
  EXPECT_THAT(store().ReadObservations("s-test", "a", visit), IsOk());
}

TEST_P(StoreRead, SaysSoWhenTheSessionIsDeletedMeanwhile) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  Append(MakeBatch(KeyOf("b"), 1, 5));
  const auto visit = [&](StoredBatch) { return store().DeleteSession("s-test"); };
  EXPECT_THAT(store().ReadObservations("s-test", "", visit),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("deleted")));
}

TEST_P(StoreRead, GivesClockReadingsOfEpochsWithoutRows) {
  Delivery delivery = MakeDelivery(MakeBatch(KeyOf("a"), 1, 5, 0));
  delivery.batch.clock_samples = {{.device_ns = 1, .host_monotonic_ns = 1, .host_utc_ns = 1}};
  Append(delivery);
  Delivery without_rows;
  without_rows.batch.stream = KeyOf("a");
  without_rows.batch.clock_epoch = 4;
  without_rows.batch.clock_samples = {{.device_ns = 2, .host_monotonic_ns = 2, .host_utc_ns = 2}};
  Append(without_rows);
  std::vector<std::string> seen;
  const auto visit = [&](StoredBatch stored) {
    seen.push_back(std::to_string(stored.batch.clock_epoch) + ": " +
                   std::to_string(stored.batch.rows()) + " rows, sample " +
                   std::to_string(stored.batch.clock_samples.at(0).device_ns));
    return absl::OkStatus();
  };
  ASSERT_THAT(store().ReadObservations("s-test", "a", visit), IsOk());
  EXPECT_THAT(seen, ::testing::ElementsAre("0: 5 rows, sample 1", "4: 0 rows, sample 2"));
}

TEST_P(StoreRead, ReadsWhileOthersWrite) {
  std::thread writing([&] {
    for (uint32_t i = 0; i < 50; ++i) Append(MakeBatch(KeyOf("a"), 1 + 4 * i, 4 + 4 * i));
  });
  size_t last = 0;
  for (int i = 0; i < 50; ++i) {
    const size_t rows = ReadRows(store()).size();
    EXPECT_GE(rows, last);
    last = rows;
    EXPECT_THAT(store().GetSessionCounts("s-test"), IsOk());
  }
  writing.join();
  EXPECT_EQ(ReadRows(store()).size(), 200u);
}

RIGCAL_FOR_EVERY_STORE(StoreRead);

}  // namespace
}  // namespace rigcal::server::store_read_test
