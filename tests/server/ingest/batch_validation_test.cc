// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/batch_validation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::batch_validation_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::IsEmpty;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr size_t kIndex = 17;  // third marker of row 5, which is seq 106 and wholly visible

StreamContext Context() {
  return {.image_size_px = {.width = 1280, .height = 1024}, .marker_count = 3};
}

ObservationBatch GoodBatch() { return MakeBatch(KeyOf("a"), 101, 110); }

std::vector<RefusedRow> Validate(const ObservationBatch& batch) {
  auto refused_rows = ValidateBatch(Context(), batch);
  EXPECT_THAT(refused_rows, IsOk());
  return refused_rows.ok() ? *std::move(refused_rows) : std::vector<RefusedRow>();
}

TEST(BatchValidation, FindsNothingInAGoodBatch) {
  EXPECT_THAT(Validate(GoodBatch()), IsEmpty());
  EXPECT_EQ(GoodBatch().visible_mask[5], 7u);
}

struct Fault {
  const char* value;  // field and index
  RefusalReason reason;
};

struct BadValue {
  const char* name;
  std::function<void(ObservationBatch&)> spoil;
  Fault fault;
};

class BadValues : public ::testing::TestWithParam<BadValue> {};

TEST_P(BadValues, RefusesThatRowAndNamesTheValue) {
  ObservationBatch batch = GoodBatch();
  GetParam().spoil(batch);
  const std::vector<RefusedRow> refused_rows = Validate(batch);
  ASSERT_EQ(refused_rows.size(), 1u);
  const RefusedRow& refused = refused_rows[0];
  EXPECT_EQ(refused.row, 5u);
  EXPECT_EQ(std::string(refused.field) + "[" + std::to_string(refused.value) + "]",
            GetParam().fault.value);
  EXPECT_EQ(refused.reason, GetParam().fault.reason);
  EXPECT_FALSE(refused.detail.empty());
}

INSTANTIATE_TEST_SUITE_P(
    BatchValidation, BadValues,
    ::testing::Values(BadValue{"NanX",
                               [](auto& b) { b.x_px[kIndex] = kNan; },
                               {"x_px[17]", RefusalReason::kNotFinite}},
                      BadValue{"InfiniteY",
                               [](auto& b) { b.y_px[kIndex] = -kInfinity; },
                               {"y_px[17]", RefusalReason::kNotFinite}},
                      BadValue{"NanXX",
                               [](auto& b) { b.cov_xx_px2[kIndex] = kNan; },
                               {"cov_xx_px2[17]", RefusalReason::kNotFinite}},
                      BadValue{"NanXY",
                               [](auto& b) { b.cov_xy_px2[kIndex] = kNan; },
                               {"cov_xy_px2[17]", RefusalReason::kNotFinite}},
                      BadValue{"InfiniteYY",
                               [](auto& b) { b.cov_yy_px2[kIndex] = kInfinity; },
                               {"cov_yy_px2[17]", RefusalReason::kNotFinite}},
                      BadValue{"NanConfidence",
                               [](auto& b) { b.label_confidence[kIndex] = kNan; },
                               {"label_confidence[17]", RefusalReason::kNotFinite}},
                      BadValue{"FarLeft",
                               [](auto& b) { b.x_px[kIndex] = -1281; },
                               {"x_px[17]", RefusalReason::kFarOutsideImage}},
                      BadValue{"FarRight",
                               [](auto& b) { b.x_px[kIndex] = 2560; },
                               {"x_px[17]", RefusalReason::kFarOutsideImage}},
                      BadValue{"FarAbove",
                               [](auto& b) { b.y_px[kIndex] = -1025; },
                               {"y_px[17]", RefusalReason::kFarOutsideImage}},
                      BadValue{"FarBelow",
                               [](auto& b) { b.y_px[kIndex] = 2048; },
                               {"y_px[17]", RefusalReason::kFarOutsideImage}},
                      BadValue{"ZeroVariance",
                               [](auto& b) { b.cov_yy_px2[kIndex] = 0; },
                               {"cov_xx_px2[17]", RefusalReason::kBadCovariance}},
                      BadValue{"NegativeVariance",
                               [](auto& b) { b.cov_xx_px2[kIndex] = -1; },
                               {"cov_xx_px2[17]", RefusalReason::kBadCovariance}},
                      BadValue{"Indefinite",
                               [](auto& b) { b.cov_xy_px2[kIndex] = 0.3f; },
                               {"cov_xx_px2[17]", RefusalReason::kBadCovariance}},
                      BadValue{"Singular",
                               [](auto& b) {
                                 b.cov_xx_px2[kIndex] = b.cov_xy_px2[kIndex] =
                                     b.cov_yy_px2[kIndex] = 0.25f;
                               },
                               {"cov_xx_px2[17]", RefusalReason::kBadCovariance}},
                      BadValue{"LargerThanTheImage",
                               [](auto& b) { b.cov_xx_px2[kIndex] = 3e6f; },
                               {"cov_xx_px2[17]", RefusalReason::kBadCovariance}},
                      BadValue{"EndlessNegativeTime",
                               [](auto& b) { b.time_ns[5] = -(int64_t{1} << 62) - 1; },
                               {"time_ns[5]", RefusalReason::kImplausibleTime}},
                      BadValue{"EndlessTime",
                               [](auto& b) { b.time_ns[5] = (int64_t{1} << 62) + 1; },
                               {"time_ns[5]", RefusalReason::kImplausibleTime}},
                      BadValue{"TimeBeforeTheRowAhead",
                               [](auto& b) { b.time_ns[5] = b.time_ns[4] - 1; },
                               {"time_ns[5]", RefusalReason::kTimeNotIncreasing}},
                      BadValue{"LateMarker",
                               [](auto& b) { b.time_delta_ns[kIndex] = 1'000'000'001; },
                               {"time_delta_ns[17]", RefusalReason::kTimeDeltaTooLarge}},
                      BadValue{"EarlyMarker",
                               [](auto& b) {
                                 b.time_delta_ns[kIndex] = std::numeric_limits<int32_t>::min();
                               },
                               {"time_delta_ns[17]", RefusalReason::kTimeDeltaTooLarge}},
                      BadValue{"ConfidenceAboveOne",
                               [](auto& b) { b.label_confidence[kIndex] = 1.01f; },
                               {"label_confidence[17]", RefusalReason::kBadLabelConfidence}},
                      BadValue{"NegativeConfidence",
                               [](auto& b) { b.label_confidence[kIndex] = -0.01f; },
                               {"label_confidence[17]", RefusalReason::kBadLabelConfidence}}),
    [](const auto& bad_value) { return bad_value.param.name; });

TEST(BatchValidation, TakesValuesAtTheirLimits) {
  ObservationBatch batch = GoodBatch();
  batch.x_px[kIndex] = -1280.5f;
  batch.y_px[kIndex] = 2047.5f;
  batch.time_delta_ns[kIndex] = -1'000'000'000;
  batch.label_confidence[kIndex] = 0;
  batch.label_confidence[kIndex - 1] = 1;
  batch.time_ns[9] = int64_t{1} << 62;
  EXPECT_THAT(Validate(batch), IsEmpty());
}

// Two rows of one time are duplicates or a contradiction: which, association decides.
TEST(BatchValidation, TakesEqualTimes) {
  ObservationBatch batch = GoodBatch();
  batch.time_ns[5] = batch.time_ns[4];
  EXPECT_THAT(Validate(batch), IsEmpty());
}

TEST(BatchValidation, ComparesTimesWithTheLastRowThatWasTaken) {
  ObservationBatch batch = GoodBatch();
  batch.time_ns[2] = std::numeric_limits<int64_t>::max();  // refused: those after it are not
  const std::vector<RefusedRow> refused_rows = Validate(batch);
  ASSERT_EQ(refused_rows.size(), 1u);
  EXPECT_EQ(refused_rows[0].row, 2u);
}

TEST(BatchValidation, DoesNotLookAtInvisibleMarkers) {
  ObservationBatch batch = GoodBatch();
  batch.visible_mask[5] = 3;
  batch.x_px[kIndex] = kNan;
  batch.label_confidence[kIndex] = -5;
  batch.centre_kind[kIndex] = 0;
  EXPECT_THAT(Validate(batch), IsEmpty());
}

TEST(BatchValidation, RefusesAnotherMarkerCountThanTheTargets) {
  ObservationBatch batch = GoodBatch();
  batch.marker_count = 2;
  EXPECT_THAT(ValidateBatch(Context(), batch),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       "marker_count is 2, but the session's target has 3 markers"));
}

TEST(BatchValidation, TakesDroppedRangesWithoutRows) {
  ObservationBatch batch;
  batch.dropped = {{.first_seq = 1, .count = 2, .reason = RefusalReason::kSpoolFreed}};
  EXPECT_THAT(Validate(batch), IsEmpty());
}

}  // namespace
}  // namespace rigcal::server::batch_validation_test
