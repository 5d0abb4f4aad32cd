// SPDX-License-Identifier: Apache-2.0
#include "server/live/arrivals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/store/store_fixture.h"

namespace rigcal::testing::arrivals_test {
namespace {

using ::testing::IsEmpty;
using ::testing::Le;
using ::testing::SizeIs;

// Rows at `rate_hz` from `first_s` on; each second one has the wand.
server::Delivery Rows(double first_s, int rows, double rate_hz) {
  server::Delivery delivery;
  delivery.batch.stream = KeyOf("left");
  delivery.batch.marker_count = 1;
  for (int i = 0; i < rows; ++i) {
    Observation row{.time_ns = static_cast<int64_t>(1e9 * (first_s + i / rate_hz)), .markers = {}};
    row.markers.resize(1);
    row.markers[0].visible = i % 2 == 0;
    delivery.batch.Append(row);
  }
  return delivery;
}

server::AppendOutcome Stored(uint32_t rows) {
  server::AppendOutcome outcome;
  outcome.stored_rows = rows;
  return outcome;
}

TEST(ArrivalInbox, CountsAllAndKeepsFew) {
  server::ArrivalInbox inbox;
  inbox.Add(Rows(0, 1000, 1000), Stored(1000), {});
  const auto taken = inbox.Take();
  ASSERT_THAT(taken, SizeIs(1));
  const server::Arrivals& arrivals = taken[0].second;
  EXPECT_EQ(arrivals.stored_count, 1000u);
  EXPECT_EQ(arrivals.wand_count, 500u);
  EXPECT_EQ(arrivals.newest_row_ns, 999'000'000);
  // A second at 60 Hz.
  EXPECT_THAT(arrivals.rows, SizeIs(::testing::AllOf(Le(63u), ::testing::Ge(50u))));
  EXPECT_THAT(inbox.Take(), IsEmpty());
}

TEST(ArrivalInbox, ThinsAcrossBatches) {
  server::ArrivalInbox inbox;
  for (int i = 0; i < 100; ++i) inbox.Add(Rows(0.01 * i, 10, 1000), Stored(10), {});
  EXPECT_THAT(inbox.Take()[0].second.rows, SizeIs(Le(63u)));
}

TEST(ArrivalInbox, IsBounded) {
  server::ArrivalInbox inbox;
  for (int i = 0; i < 100; ++i) inbox.Add(Rows(10.0 * i, 500, 50), Stored(500), {});
  const auto taken = inbox.Take();
  EXPECT_EQ(taken[0].second.stored_count, 50'000u);
  EXPECT_THAT(taken[0].second.rows, SizeIs(128));
}

TEST(ArrivalInbox, LeavesRefusedRowsOut) {
  server::ArrivalInbox inbox;
  server::Delivery delivery = Rows(0, 10, 50);
  delivery.refused_rows = {{.row = 0}, {.row = 3}};
  server::AppendOutcome outcome = Stored(8);
  outcome.refused_rows = 2;
  inbox.Add(delivery, outcome, {});
  const server::Arrivals arrivals = inbox.Take()[0].second;
  EXPECT_EQ(arrivals.stored_count, 8u);
  EXPECT_EQ(arrivals.refused_count, 2u);
  EXPECT_EQ(arrivals.wand_count, 4u);
  ASSERT_THAT(arrivals.rows, SizeIs(8));
  EXPECT_EQ(arrivals.rows.front().time_ns, 20'000'000);
}

TEST(ArrivalInbox, TakesWhatIsNewOfABatch) {
  server::ArrivalInbox inbox;
  inbox.Add(Rows(0, 50, 50), Stored(0), {});
  inbox.Add(Rows(0, 50, 50), Stored(10), {});
  const server::Arrivals arrivals = inbox.Take()[0].second;
  EXPECT_EQ(arrivals.stored_count, 10u);
  EXPECT_EQ(arrivals.wand_count, 5u);
  ASSERT_THAT(arrivals.rows, SizeIs(10));
  EXPECT_EQ(arrivals.rows.front().time_ns, 800'000'000);
}

}  // namespace
}  // namespace rigcal::testing::arrivals_test
