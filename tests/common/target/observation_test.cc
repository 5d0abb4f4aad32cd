// SPDX-License-Identifier: Apache-2.0
#include "common/target/observation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::observation_test {
namespace {

using ::testing::ElementsAre;
using ::testing::SizeIs;

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
  batch.session_id = "s";
  batch.camera = "c";
  batch.stream_epoch = 4;
  batch.first_seq = 11;
  batch.clock_epoch = 2;
  batch.marker_count = 3;
  for (int i = 0; i < rows; ++i) batch.Append(MakeObservation(i));
  batch.clock_samples.resize(1);
  batch.host_alignments.resize(1);
  batch.dropped.push_back({1, 10, "spool_full"});
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
  EXPECT_EQ(slice.session_id, "s");
  EXPECT_EQ(slice.camera, "c");
  EXPECT_EQ(slice.stream_epoch, 4u);
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

}  // namespace
}  // namespace rigcal::observation_test
