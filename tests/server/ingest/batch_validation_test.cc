// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/batch_validation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "server/store/stream_ledger.h"
#include "tests/server/store/sqlite/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::batch_validation_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::_;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr size_t kIndex = 17;  // third marker of row 5, which is seq 106 and wholly visible

StreamContext Context() {
  return {.image_size_px = {.width = 1280, .height = 1024}, .marker_count = 3};
}

ObservationBatch GoodBatch() { return MakeBatch(KeyOf("a"), 101, 110); }

BatchFaults Validate(const ObservationBatch& batch) {
  BatchFaults faults;
  EXPECT_THAT(ValidateBatch(Context(), batch, &faults), IsOk());
  return faults;
}

TEST(BatchValidation, FindsNothingInAGoodBatch) {
  const BatchFaults faults = Validate(GoodBatch());
  EXPECT_THAT(faults.rows, IsEmpty());
  EXPECT_THAT(faults.listed, IsEmpty());
  EXPECT_EQ(GoodBatch().visible_mask[5], 7u);
}

struct BadValue {
  const char* name;
  std::function<void(ObservationBatch&)> spoil;
  ObservationFault fault;
};

class BadValues : public ::testing::TestWithParam<BadValue> {};

TEST_P(BadValues, RefusesThatRowAndNamesTheValue) {
  ObservationBatch batch = GoodBatch();
  GetParam().spoil(batch);
  const BatchFaults faults = Validate(batch);
  EXPECT_THAT(faults.listed, ElementsAre(GetParam().fault));
  ASSERT_EQ(faults.rows.size(), 1u);
  EXPECT_EQ(faults.rows[0].row, 5u);
  EXPECT_EQ(faults.rows[0].reason, GetParam().fault.reason);
  EXPECT_FALSE(faults.rows[0].detail.empty());
}

ObservationFault Fault(const char* field, const char* reason) {
  return {.seq = 106, .field = field, .reason = reason};
}

INSTANTIATE_TEST_SUITE_P(
    BatchValidation, BadValues,
    ::testing::Values(
        BadValue{"NanX", [](auto& b) { b.x_px[kIndex] = kNan; }, Fault("x_px[17]", "not_finite")},
        BadValue{"InfiniteY", [](auto& b) { b.y_px[kIndex] = -kInfinity; },
                 Fault("y_px[17]", "not_finite")},
        BadValue{"NanXX", [](auto& b) { b.cov_xx_px2[kIndex] = kNan; },
                 Fault("cov_xx_px2[17]", "not_finite")},
        BadValue{"NanXY", [](auto& b) { b.cov_xy_px2[kIndex] = kNan; },
                 Fault("cov_xy_px2[17]", "not_finite")},
        BadValue{"InfiniteYY", [](auto& b) { b.cov_yy_px2[kIndex] = kInfinity; },
                 Fault("cov_yy_px2[17]", "not_finite")},
        BadValue{"NanConfidence", [](auto& b) { b.label_confidence[kIndex] = kNan; },
                 Fault("label_confidence[17]", "not_finite")},
        BadValue{"FarLeft", [](auto& b) { b.x_px[kIndex] = -1281; },
                 Fault("x_px[17]", "far_outside_image")},
        BadValue{"FarRight", [](auto& b) { b.x_px[kIndex] = 2560; },
                 Fault("x_px[17]", "far_outside_image")},
        BadValue{"FarAbove", [](auto& b) { b.y_px[kIndex] = -1025; },
                 Fault("y_px[17]", "far_outside_image")},
        BadValue{"FarBelow", [](auto& b) { b.y_px[kIndex] = 2048; },
                 Fault("y_px[17]", "far_outside_image")},
        BadValue{"ZeroVariance", [](auto& b) { b.cov_yy_px2[kIndex] = 0; },
                 Fault("cov_xx_px2[17]", "bad_covariance")},
        BadValue{"NegativeVariance", [](auto& b) { b.cov_xx_px2[kIndex] = -1; },
                 Fault("cov_xx_px2[17]", "bad_covariance")},
        BadValue{"Indefinite", [](auto& b) { b.cov_xy_px2[kIndex] = 0.3f; },
                 Fault("cov_xx_px2[17]", "bad_covariance")},
        BadValue{"Singular",
                 [](auto& b) {
                   b.cov_xx_px2[kIndex] = b.cov_xy_px2[kIndex] = b.cov_yy_px2[kIndex] = 0.25f;
                 },
                 Fault("cov_xx_px2[17]", "bad_covariance")},
        BadValue{"LargerThanTheImage", [](auto& b) { b.cov_xx_px2[kIndex] = 3e6f; },
                 Fault("cov_xx_px2[17]", "bad_covariance")},
        BadValue{"NegativeTime", [](auto& b) { b.time_ns[5] = -1; },
                 Fault("time_ns[5]", "implausible_time")},
        BadValue{"EndlessTime", [](auto& b) { b.time_ns[5] = (int64_t{1} << 62) + 1; },
                 Fault("time_ns[5]", "implausible_time")},
        BadValue{"TimeBeforeTheRowAhead", [](auto& b) { b.time_ns[5] = b.time_ns[4] - 1; },
                 Fault("time_ns[5]", "time_not_increasing")},
        BadValue{"LateMarker", [](auto& b) { b.time_delta_ns[kIndex] = 1'000'000'001; },
                 Fault("time_delta_ns[17]", "time_delta_too_large")},
        BadValue{"EarlyMarker",
                 [](auto& b) { b.time_delta_ns[kIndex] = std::numeric_limits<int32_t>::min(); },
                 Fault("time_delta_ns[17]", "time_delta_too_large")},
        BadValue{"ConfidenceAboveOne", [](auto& b) { b.label_confidence[kIndex] = 1.01f; },
                 Fault("label_confidence[17]", "bad_label_confidence")},
        BadValue{"NegativeConfidence", [](auto& b) { b.label_confidence[kIndex] = -0.01f; },
                 Fault("label_confidence[17]", "bad_label_confidence")}),
    [](const auto& bad_value) { return bad_value.param.name; });

TEST(BatchValidation, TakesValuesAtTheirLimits) {
  ObservationBatch batch = GoodBatch();
  batch.x_px[kIndex] = -1280.5f;
  batch.y_px[kIndex] = 2047.5f;
  batch.time_delta_ns[kIndex] = -1'000'000'000;
  batch.label_confidence[kIndex] = 0;
  batch.label_confidence[kIndex - 1] = 1;
  batch.time_ns[9] = int64_t{1} << 62;
  EXPECT_THAT(Validate(batch).rows, IsEmpty());
}

// Two rows of one time are duplicates or a contradiction: which, association decides.
TEST(BatchValidation, TakesEqualTimes) {
  ObservationBatch batch = GoodBatch();
  batch.time_ns[5] = batch.time_ns[4];
  EXPECT_THAT(Validate(batch).rows, IsEmpty());
}

TEST(BatchValidation, ComparesTimesWithTheLastRowThatWasTaken) {
  ObservationBatch batch = GoodBatch();
  batch.time_ns[2] = std::numeric_limits<int64_t>::max();  // refused: those after it are not
  const BatchFaults faults = Validate(batch);
  ASSERT_EQ(faults.rows.size(), 1u);
  EXPECT_EQ(faults.rows[0].row, 2u);
}

TEST(BatchValidation, DoesNotLookAtInvisibleMarkers) {
  ObservationBatch batch = GoodBatch();
  batch.visible_mask[5] = 3;
  batch.x_px[kIndex] = kNan;
  batch.label_confidence[kIndex] = -5;
  batch.centre_kind[kIndex] = 0;
  EXPECT_THAT(Validate(batch).rows, IsEmpty());
}

TEST(BatchValidation, ListsTheFirstFaultsAndCountsAll) {
  ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 200);
  for (int64_t& time_ns : batch.time_ns) time_ns = -7;
  const BatchFaults faults = Validate(batch);
  EXPECT_EQ(faults.rows.size(), 200u);
  ASSERT_EQ(faults.listed.size(), kMaxListedFaults);
  EXPECT_EQ(faults.listed.back().seq, kMaxListedFaults);
}

TEST(BatchValidation, ForgetsTheBatchBefore) {
  ObservationBatch bad = GoodBatch();
  bad.x_px[kIndex] = kNan;
  BatchFaults faults;
  ASSERT_THAT(ValidateBatch(Context(), bad, &faults), IsOk());
  ASSERT_THAT(ValidateBatch(Context(), GoodBatch(), &faults), IsOk());
  EXPECT_THAT(faults.rows, IsEmpty());
  EXPECT_THAT(faults.listed, IsEmpty());
}

void ExpectProtocolFault(const ObservationBatch& batch, const std::string& field) {
  BatchFaults faults;
  EXPECT_THAT(ValidateBatch(Context(), batch, &faults),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(field)));
}

TEST(BatchValidation, TakesFaultsInProtocolAsSuch) {
  ObservationBatch batch = GoodBatch();
  batch.marker_count = 2;
  ExpectProtocolFault(batch, "marker_count is 2, but the session's target has 3");
  batch = GoodBatch();
  batch.cov_yy_px2.push_back(1);
  ExpectProtocolFault(batch, "cov_yy_px2");
  batch = GoodBatch();
  batch.visible_mask[4] = 8;
  ExpectProtocolFault(batch, "visible_mask[4]");
  batch = GoodBatch();
  batch.centre_kind[kIndex] = 3;
  ExpectProtocolFault(batch, "centre_kind[17]");
  batch = GoodBatch();
  batch.first_seq = 0;
  ExpectProtocolFault(batch, "first_seq");
  batch.first_seq = kMaxSeq - 8;
  ExpectProtocolFault(batch, "first_seq");
  batch = GoodBatch();
  batch.dropped = {{.first_seq = 1, .count = 2, .reason = "x"},
                   {.first_seq = 0, .count = 2, .reason = "x"}};
  ExpectProtocolFault(batch, "dropped[1]");
}

TEST(BatchValidation, TakesDroppedRangesWithoutRows) {
  ObservationBatch batch;
  batch.dropped = {{.first_seq = 1, .count = 2, .reason = "x"}};
  EXPECT_THAT(Validate(batch).rows, IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::batch_validation_test
