// SPDX-License-Identifier: Apache-2.0
#include "server/store/delivery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/server/store/store_fixture.h"

namespace rigcal::testing::delivery_test {
namespace {

using server::AcceptedRows;
using ::testing::IsEmpty;
using ::testing::SizeIs;

server::StoredBatch Stored(std::vector<bool> refused, bool samples = false) {
  server::StoredBatch stored;
  stored.batch = MakeBatch(KeyOf("left"), 11, 16);
  stored.refused_rows = std::move(refused);
  if (samples) {
    stored.batch.clock_samples.resize(2);
    stored.batch.host_alignments.resize(1);
  }
  return stored;
}

TEST(AcceptedRows, LeavesABatchWithoutRefusalsAsItIs) {
  const auto batches = AcceptedRows(Stored({}, true));
  ASSERT_THAT(batches, SizeIs(1));
  EXPECT_EQ(batches[0].rows(), 6u);
  EXPECT_THAT(batches[0].clock_samples, SizeIs(2));
}

TEST(AcceptedRows, CutsRefusedRowsOutAndKeepsTheNumbers) {
  const auto batches = AcceptedRows(Stored({true, false, false, true, true, false}, true));
  ASSERT_THAT(batches, SizeIs(2));
  EXPECT_EQ(batches[0].first_seq, 12u);
  EXPECT_EQ(batches[0].rows(), 2u);
  EXPECT_EQ(batches[0].time_ns[1], MakeBatch(KeyOf("left"), 11, 16).time_ns[2]);
  EXPECT_THAT(batches[0].clock_samples, SizeIs(2));
  EXPECT_THAT(batches[0].host_alignments, SizeIs(1));
  EXPECT_EQ(batches[1].first_seq, 16u);
  EXPECT_EQ(batches[1].rows(), 1u);
  EXPECT_THAT(batches[1].clock_samples, IsEmpty());
}

TEST(AcceptedRows, KeepsTheSamplesOfABatchThatWasRefusedWhole) {
  const std::vector<bool> all(6, true);
  EXPECT_THAT(AcceptedRows(Stored(all)), IsEmpty());
  const auto batches = AcceptedRows(Stored(all, true));
  ASSERT_THAT(batches, SizeIs(1));
  EXPECT_EQ(batches[0].rows(), 0u);
  EXPECT_THAT(batches[0].clock_samples, SizeIs(2));
}

}  // namespace
}  // namespace rigcal::testing::delivery_test
