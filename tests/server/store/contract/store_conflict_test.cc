// SPDX-License-Identifier: Apache-2.0
// The same key with other values is a conflict: the first row stays, and it is counted, and never
// taken for a duplicate.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::store_conflict_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::ReadRows;
using ::testing::HasSubstr;
using ::testing::Not;

class StoreConflict : public ::rigcal::testing::StoreContract {
 protected:
  void SetUp() override {
    StoreContract::SetUp();
    ASSERT_THAT(store().CreateSession(CapturingSession({"a", "b"})), IsOk());
  }
  AppendOutcome AppendDropped(uint32_t first, uint32_t count) {
    Delivery delivery;
    delivery.batch.stream = KeyOf("a");
    delivery.batch.dropped = {
        {.first_seq = first, .count = count, .reason = RefusalReason::kSpoolFreed}};
    return Append(delivery);
  }
};

// Rows 1 to 40, with every `step`th changed.
ObservationBatch Forged(uint32_t first, uint32_t last, uint32_t step) {
  ObservationBatch batch = MakeBatch(KeyOf("a"), first, last);
  for (size_t row = 0; row < batch.rows(); row += step) batch.time_ns[row] += 1;
  return batch;
}

TEST_P(StoreConflict, TheFirstStaysAndTheOthersAreCounted) {
  Append(MakeBatch(KeyOf("a"), 1, 40));
  const auto rows = ReadRows(store());
  const AppendOutcome outcome = Append(Forged(1, 40, 4));
  EXPECT_EQ(outcome.conflict_rows, 10u);
  EXPECT_EQ(outcome.duplicate_rows, 30u);
  EXPECT_EQ(outcome.stored_rows, 0u);
  EXPECT_EQ(outcome.durable_seq, 40u);
  EXPECT_TRUE(ReadRows(store()) == rows);
  EXPECT_THAT(CountsText(store()), HasSubstr("conflict: 10 (seq 1: delivered again"));
}

TEST_P(StoreConflict, EveryColumnCounts) {
  Append(MakeBatch(KeyOf("a"), 1, 5));
  const auto expect_conflict = [&](const char* what, auto change) {
    ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 5);
    change(&batch);
    const AppendOutcome outcome = Append(std::move(batch));
    EXPECT_EQ(outcome.conflict_rows, 1u) << what;
    EXPECT_EQ(outcome.duplicate_rows, 4u) << what;
  };
  expect_conflict("time", [](ObservationBatch* b) { b->time_ns[2] += 1; });
  expect_conflict("mask", [](ObservationBatch* b) { b->visible_mask[2] = 0; });
  expect_conflict("x", [](ObservationBatch* b) { b->x_px[6] += 0.5f; });
  expect_conflict("y", [](ObservationBatch* b) { b->y_px[7] += 0.5f; });
  expect_conflict("cov_xx", [](ObservationBatch* b) { b->cov_xx_px2[8] = 1; });
  expect_conflict("cov_xy", [](ObservationBatch* b) { b->cov_xy_px2[6] = 0.1f; });
  expect_conflict("cov_yy", [](ObservationBatch* b) { b->cov_yy_px2[6] = 1; });
  expect_conflict("time_delta", [](ObservationBatch* b) { b->time_delta_ns[7] = 3; });
  expect_conflict("confidence", [](ObservationBatch* b) { b->label_confidence[6] = 0.1f; });
  expect_conflict("kind", [](ObservationBatch* b) { b->centre_kind[6] ^= 3; });
  EXPECT_THAT(Append(MakeBatch(KeyOf("a"), 1, 5, /*clock_epoch=*/1)).conflict_rows, 5u);
}

TEST_P(StoreConflict, ReplaysAreDuplicatesHoweverTheyAreCut) {
  Append(MakeBatch(KeyOf("a"), 1, 10));
  Append(MakeBatch(KeyOf("a"), 21, 30));
  Append(MakeBatch(KeyOf("a"), 11, 20));
  for (uint32_t width = 1; width <= 30; ++width) {
    for (uint32_t first = 1; first + width <= 31; ++first) {
      const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), first, first + width - 1));
      ASSERT_EQ(outcome.duplicate_rows, width) << first;
      ASSERT_EQ(outcome.conflict_rows, 0u) << first;
    }
  }
  EXPECT_THAT(CountsText(store()), Not(HasSubstr("conflict")));
}

TEST_P(StoreConflict, NewRowsOfAForgedBatchAreStored) {
  Append(MakeBatch(KeyOf("a"), 11, 20));
  const AppendOutcome outcome = Append(Forged(1, 30, 1));
  EXPECT_EQ(outcome.stored_rows, 20u);
  EXPECT_EQ(outcome.conflict_rows, 10u);
  EXPECT_EQ(outcome.duplicate_rows, 0u);
}

TEST_P(StoreConflict, RefusedRowsEqualThemselves) {
  const auto with_nan = [] {
    Delivery delivery = testing::MakeDelivery(MakeBatch(KeyOf("a"), 1, 6));
    delivery.batch.x_px[3] = std::numeric_limits<float>::quiet_NaN();
    delivery.refused_rows.push_back({.row = 1, .reason = RefusalReason::kNotFinite});
    return delivery;
  };
  Append(with_nan());
  const AppendOutcome outcome = Append(with_nan());
  EXPECT_EQ(outcome.duplicate_rows, 6u);
  EXPECT_EQ(outcome.conflict_rows, 0u);
}

TEST_P(StoreConflict, RowsThatWereReportedAsLostAreConflicts) {
  Append(MakeBatch(KeyOf("a"), 1, 10));
  AppendDropped(11, 3);
  AppendDropped(14, 4);
  Append(MakeBatch(KeyOf("a"), 18, 20));
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 6, 20));
  EXPECT_EQ(outcome.conflict_rows, 7u);
  EXPECT_EQ(outcome.duplicate_rows, 8u);
  EXPECT_THAT(CountsText(store()), HasSubstr("conflict: 7 (seq 11:"));
}

TEST_P(StoreConflict, OtherCamerasAndEpochsDoNotConflict) {
  Append(MakeBatch(KeyOf("a"), 1, 10));
  EXPECT_EQ(Append(MakeBatch(KeyOf("a", 2), 1, 10)).stored_rows, 10u);
  EXPECT_EQ(Append(MakeBatch(KeyOf("b"), 1, 10)).stored_rows, 10u);
  EXPECT_EQ(Append(MakeBatch(KeyOf("a"), 1, 10)).duplicate_rows, 10u);
  EXPECT_THAT(CountsText(store()), Not(HasSubstr("conflict")));
}

TEST_P(StoreConflict, ReplaysOfDeletedObservationsAreDuplicates) {
  Append(MakeBatch(KeyOf("a"), 1, 10));
  ASSERT_THAT(store().DeleteObservations("s-test", 5), IsOk());
  EXPECT_TRUE(ReadRows(store()).empty());
  const AppendOutcome outcome = Append(MakeBatch(KeyOf("a"), 1, 10));
  EXPECT_EQ(outcome.duplicate_rows, 10u);
  EXPECT_EQ(outcome.conflict_rows, 0u);
}

RIGCAL_FOR_EVERY_STORE(StoreConflict);

}  // namespace
}  // namespace rigcal::server::store_conflict_test
