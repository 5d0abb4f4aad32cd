// SPDX-License-Identifier: Apache-2.0
#include "common/session/observation_batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::observation_batch_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::ElementsAre;
using ::testing::SizeIs;
using ::testing::StartsWith;

// Row `i` with the middle marker missing in odd rows. Values fit a float exactly.
Observation MakeObservation(int i) {
  Observation observation;
  observation.time_ns = 1000 * i;
  observation.clock_epoch = 2;
  observation.markers.resize(3);
  for (int m = 0; m < 3; ++m) {
    if (i % 2 == 1 && m == 1) continue;
    MarkerObservation& marker = observation.markers[static_cast<size_t>(m)];
    marker.visible = true;
    marker.centre_px = {100 * i + m + 0.5, 200 * i + m + 0.25};
    marker.covariance_px2 << 0.5, 0.125, 0.125, 2;
    marker.time_delta_ns = 10 * i + m;
    marker.label_confidence = 0.75f;
    marker.centre_kind = CentreKind::kSphereCentre;
  }
  return observation;
}

ObservationBatch MakeBatch(int rows) {
  ObservationBatch batch;
  batch.stream = {"s", "c", 4};
  batch.first_seq = 11;
  batch.clock_epoch = 2;
  batch.marker_count = 3;
  for (int i = 0; i < rows; ++i) batch.Append(MakeObservation(i));
  batch.clock_samples.resize(1);
  batch.host_alignments.resize(1);
  batch.dropped.push_back({1, 10, RefusalReason::kSpoolFreed});
  return batch;
}

void ExpectEqual(const Observation& a, const Observation& b) {
  EXPECT_EQ(a.time_ns, b.time_ns);
  EXPECT_EQ(a.clock_epoch, b.clock_epoch);
  ASSERT_EQ(a.markers.size(), b.markers.size());
  for (size_t m = 0; m < a.markers.size(); ++m) {
    EXPECT_EQ(a.markers[m].visible, b.markers[m].visible);
    EXPECT_EQ(a.markers[m].centre_px, b.markers[m].centre_px);
    EXPECT_EQ(a.markers[m].covariance_px2, b.markers[m].covariance_px2);
    EXPECT_EQ(a.markers[m].time_delta_ns, b.markers[m].time_delta_ns);
    EXPECT_EQ(a.markers[m].label_confidence, b.markers[m].label_confidence);
    EXPECT_EQ(a.markers[m].centre_kind, b.markers[m].centre_kind);
  }
}

TEST(ObservationBatch, GivesBackTheRowsThatWereAppended) {
  const ObservationBatch batch = MakeBatch(5);
  ASSERT_EQ(batch.rows(), 5u);
  EXPECT_EQ(batch.end_seq(), 16u);
  for (int i = 0; i < 5; ++i) ExpectEqual(batch.Row(static_cast<size_t>(i)), MakeObservation(i));
}

TEST(ObservationBatch, KeepsFullColumnsWithZerosForWhatIsNotVisible) {
  ObservationBatch batch = MakeBatch(2);
  EXPECT_THAT(batch.visible_mask, ElementsAre(0b111u, 0b101u));
  EXPECT_THAT(batch.x_px, SizeIs(6));
  EXPECT_EQ(batch.x_px[4], 0);
  EXPECT_EQ(batch.cov_xx_px2[4], 0);
  EXPECT_EQ(batch.label_confidence[4], 0);
  EXPECT_EQ(batch.centre_kind[4], 0);
  Observation empty;
  empty.clock_epoch = 2;
  empty.markers.resize(3);
  batch.Append(empty);
  EXPECT_EQ(batch.visible_mask.back(), 0u);
  EXPECT_THAT(batch.centre_kind, SizeIs(9));
  EXPECT_EQ(batch.Row(2).VisibleCount(), 0);
}

TEST(ObservationBatch, OfMoreMarkersThanAMaskHoldsSaysHowManyAreVisible) {
  ObservationBatch batch;
  batch.marker_count = 54;
  Observation observation;
  observation.markers.resize(54);
  for (const size_t m : {size_t{0}, size_t{33}, size_t{53}}) {
    observation.markers[m].visible = true;
    observation.markers[m].centre_px = {3.0 + static_cast<double>(m), 4};
  }
  batch.Append(observation);
  for (MarkerObservation& marker : observation.markers) marker = {};
  batch.Append(observation);
  EXPECT_THAT(batch.visible_mask, ElementsAre(3u, 0u));
  EXPECT_THAT(CheckShape(batch), IsOk());
  EXPECT_TRUE(batch.IsVisible(0, 53));
  EXPECT_FALSE(batch.IsVisible(0, 32));
  const Observation row = batch.Row(0);
  EXPECT_EQ(row.VisibleCount(), 3);
  EXPECT_EQ(row.markers[33].centre_px, Eigen::Vector2d(36, 4));
  batch.visible_mask[0] = 4;
  EXPECT_THAT(CheckShape(batch), StatusIs(absl::StatusCode::kInvalidArgument,
                                          ::testing::HasSubstr("visible_mask[0]: is 4, but 3")));
}

TEST(ObservationBatch, HoldsSixteenMarkers) {
  ObservationBatch batch;
  batch.marker_count = 16;
  Observation observation;
  observation.markers.resize(16);
  observation.markers.back().visible = true;
  observation.markers.back().centre_px = {3, 4};
  batch.Append(observation);
  EXPECT_EQ(batch.visible_mask[0], 1u << 15);
  const Observation row = batch.Row(0);
  ASSERT_EQ(row.markers.size(), 16u);
  EXPECT_TRUE(row.markers.back().visible);
  EXPECT_EQ(row.markers.back().centre_px, Eigen::Vector2d(3, 4));
}

TEST(ObservationBatch, SlicesKeepNumbersAndIdentity) {
  const ObservationBatch batch = MakeBatch(5);
  const ObservationBatch slice = batch.Slice(1, 4);
  EXPECT_EQ(slice.first_seq, 12u);
  EXPECT_EQ(slice.end_seq(), 15u);
  EXPECT_EQ(slice.stream, (StreamKey{"s", "c", 4}));
  EXPECT_EQ(slice.clock_epoch, 2u);
  for (int i = 0; i < 3; ++i)
    ExpectEqual(slice.Row(static_cast<size_t>(i)), MakeObservation(i + 1));
  EXPECT_THAT(slice.y_px, SizeIs(9));
  EXPECT_THAT(slice.cov_xy_px2, SizeIs(9));
  EXPECT_THAT(slice.cov_yy_px2, SizeIs(9));
  EXPECT_THAT(slice.time_delta_ns, SizeIs(9));
  EXPECT_THAT(slice.label_confidence, SizeIs(9));
}

TEST(ObservationBatch, SamplesGoWithTheFirstRowsOnly) {
  const ObservationBatch batch = MakeBatch(3);
  EXPECT_THAT(batch.Slice(0, 1).clock_samples, SizeIs(1));
  EXPECT_THAT(batch.Slice(0, 1).host_alignments, SizeIs(1));
  EXPECT_THAT(batch.Slice(0, 0).dropped, SizeIs(1));
  EXPECT_THAT(batch.Slice(1, 3).clock_samples, SizeIs(0));
  EXPECT_THAT(batch.Slice(1, 3).host_alignments, SizeIs(0));
  EXPECT_THAT(batch.Slice(1, 3).dropped, SizeIs(0));
  EXPECT_EQ(batch.Slice(3, 3).rows(), 0u);
  EXPECT_EQ(batch.Slice(3, 3).first_seq, 14u);
}

TEST(CheckShape, AcceptsWhatAppendMakes) {
  EXPECT_THAT(CheckShape(MakeBatch(5)), IsOk());
  EXPECT_THAT(CheckShape(ObservationBatch()), IsOk());
  ObservationBatch dropped_only;
  dropped_only.dropped = {{.first_seq = 1, .count = kMaxSeq, .reason = RefusalReason::kSpoolFreed}};
  EXPECT_THAT(CheckShape(dropped_only), IsOk());
  ObservationBatch last = MakeBatch(5);
  last.first_seq = kMaxSeq - 4;
  EXPECT_THAT(CheckShape(last), IsOk());
}

TEST(CheckShape, IgnoresTheKindOfInvisibleMarkers) {
  ObservationBatch batch = MakeBatch(2);
  batch.centre_kind[4] = 77;
  EXPECT_THAT(CheckShape(batch), IsOk());
}

struct ShapeFault {
  const char* name;
  std::function<void(ObservationBatch&)> damage;
  const char* message;
};

class ShapeFaults : public ::testing::TestWithParam<ShapeFault> {};

TEST_P(ShapeFaults, NamesTheField) {
  ObservationBatch batch = MakeBatch(5);
  GetParam().damage(batch);
  EXPECT_THAT(CheckShape(batch),
              StatusIs(absl::StatusCode::kInvalidArgument, StartsWith(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    CheckShape, ShapeFaults,
    ::testing::Values(
        ShapeFault{"TooManyRows", [](auto& b) { b.time_ns.resize(kMaxBatchRows + 1); }, "time_ns:"},
        ShapeFault{"NoMarkers", [](auto& b) { b.marker_count = 0; }, "marker_count: 0"},
        ShapeFault{"TooManyMarkers", [](auto& b) { b.marker_count = 201; }, "marker_count: 201"},
        ShapeFault{"ShortMask", [](auto& b) { b.visible_mask.pop_back(); },
                   "visible_mask: has 4 values, expected 5"},
        ShapeFault{"ShortX", [](auto& b) { b.x_px.pop_back(); },
                   "x_px: has 14 values, expected 15"},
        ShapeFault{"LongY", [](auto& b) { b.y_px.push_back(1); }, "y_px:"},
        ShapeFault{"ShortXX", [](auto& b) { b.cov_xx_px2.pop_back(); }, "cov_xx_px2:"},
        ShapeFault{"ShortXY", [](auto& b) { b.cov_xy_px2.pop_back(); }, "cov_xy_px2:"},
        ShapeFault{"LongYY", [](auto& b) { b.cov_yy_px2.push_back(1); }, "cov_yy_px2:"},
        ShapeFault{"NoTimeDelta", [](auto& b) { b.time_delta_ns.clear(); }, "time_delta_ns:"},
        ShapeFault{"ShortConfidence", [](auto& b) { b.label_confidence.pop_back(); },
                   "label_confidence:"},
        ShapeFault{"OneKindForAll", [](auto& b) { b.centre_kind.resize(1); }, "centre_kind:"},
        ShapeFault{"MaskBeyondTheMarkers", [](auto& b) { b.visible_mask[4] = 8; },
                   "visible_mask[4]:"},
        ShapeFault{"UnknownKind", [](auto& b) { b.centre_kind[2] = 3; }, "centre_kind[2]: 3"},
        ShapeFault{"NoKind", [](auto& b) { b.centre_kind[2] = 0; }, "centre_kind[2]: 0"},
        ShapeFault{"SeqZero", [](auto& b) { b.first_seq = 0; }, "first_seq:"},
        ShapeFault{"SeqBeyondTheLast", [](auto& b) { b.first_seq = kMaxSeq - 3; }, "first_seq:"},
        ShapeFault{"DroppedFromZero", [](auto& b) { b.dropped[0].first_seq = 0; }, "dropped[0]:"},
        ShapeFault{"DroppedNothing", [](auto& b) { b.dropped[0].count = 0; }, "dropped[0]:"},
        ShapeFault{"DroppedBeyondTheLast", [](auto& b) { b.dropped[0].count = kMaxSeq + 1; },
                   "dropped[0]:"},
        ShapeFault{"DroppedOverlapsRows", [](auto& b) { b.dropped[0].count = 11; },
                   "dropped[0]: overlaps"},
        ShapeFault{"DroppedWithoutReason",
                   [](auto& b) { b.dropped[0].reason = RefusalReason::kUnspecified; },
                   "dropped[0].reason:"}),
    [](const auto& fault) { return fault.param.name; });

}  // namespace
}  // namespace rigcal::observation_batch_test
