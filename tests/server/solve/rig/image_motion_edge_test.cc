// SPDX-License-Identifier: Apache-2.0
// Gaps, dropouts, fast turns and times that coincide.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "server/solve/rig/image_motion.h"
#include "tests/server/associate/edit_rows.h"
#include "tests/server/solve/rig/track_of_path.h"

namespace rigcal::server::image_motion_edge_test {
namespace {

constexpr double kPeriod_s = 0.02;

using Path = std::function<Eigen::Vector2d(double)>;

AlignedTrack TrackOf(const Path& path, int rows, double period_s = kPeriod_s) {
  return TrackOfPath(path, rows, period_s, 0.3);
}

void EditMarker(AlignedTrack* track, int row,
                const std::function<void(MarkerObservation& marker)>& edit) {
  EditRow(track, static_cast<size_t>(row),
          [&edit](Observation& observation) { edit(observation.markers[0]); });
}

void Hide(AlignedTrack* track, int row) {
  EditMarker(track, row, [](MarkerObservation& marker) { marker.visible = false; });
}

Eigen::Vector2d Line(double t) { return {100 + 300 * t, 200 - 100 * t}; }
Eigen::Vector2d Fast(double t) {
  return {600 + 400 * std::sin(9 * t), 400 + 300 * std::cos(9 * t)};
}

TEST(ImageMotionEdge, OfATrackWithoutRowsIsNothing) {
  const AlignedTrack track;
  const ImageMotion motion(track, 3);
  EXPECT_EQ(motion.typical_speed_px_s(), 0);
}

TEST(ImageMotionEdge, OfOneRowStaysThere) {
  const AlignedTrack track = TrackOf(Line, 1, 0);
  const ImageMotion motion(track, 1);
  const MarkerMotion at = motion.At(0, 0, 0.02);
  EXPECT_EQ(at.centre_px, Line(0));
  EXPECT_TRUE(at.velocity_px_s.isZero());
  EXPECT_EQ(motion.typical_speed_px_s(), 0);
}

TEST(ImageMotionEdge, OfTwoRowsIsALine) {
  const AlignedTrack track = TrackOf(Line, 2);
  const ImageMotion motion(track, 1);
  const MarkerMotion at = motion.At(0, 0, 0.01);
  EXPECT_LT((at.centre_px - Line(0.01)).norm(), 1e-9);
  EXPECT_LT((at.velocity_px_s - Eigen::Vector2d(300, -100)).norm(), 1e-6);
  // Half way between two rows each counts half, which a neighbour's centre does as well: what is
  // stated is a row's.
  EXPECT_NEAR(at.noise_share, 0.5, 1e-6);
  EXPECT_NEAR(at.covariance_px2(1, 1) - 0.09, 0.25 * (Line(0.01) - Line(0)).squaredNorm(), 1e-6);
}

TEST(ImageMotionEdge, MovesAlongALineExactlyAtItsEndsToo) {
  const AlignedTrack track = TrackOf(Line, 30);
  const ImageMotion motion(track, 1);
  for (const int row : {0, 1, 15, 28, 29}) {
    const MarkerMotion at = motion.At(row, 0, 0.008);
    EXPECT_LT((at.centre_px - Line(row * kPeriod_s + 0.008)).norm(), 1e-6) << row;
    EXPECT_LT((at.velocity_px_s - Eigen::Vector2d(300, -100)).norm(), 1e-4) << row;
  }
  EXPECT_NEAR(motion.typical_speed_px_s(), std::hypot(300, 100), 1e-6);
}

// Centripetal acceleration of 32 000 px/s^2: a line would be 1.6 px off after half a period.
TEST(ImageMotionEdge, FollowsAFastTurn) {
  const AlignedTrack track = TrackOf(Fast, 60);
  const ImageMotion motion(track, 1);
  for (int row = 10; row < 50; ++row) {
    const MarkerMotion at = motion.At(row, 0, 0.01);
    EXPECT_LT((at.centre_px - Fast(row * kPeriod_s + 0.01)).norm(), 0.05) << row;
  }
}

TEST(ImageMotionEdge, AtAnEndOfAFastTurnErrorAndUncertaintyGoTogether) {
  const AlignedTrack track = TrackOf(Fast, 60);
  const ImageMotion motion(track, 1);
  for (const int row : {0, 59}) {
    const double shift_s = row == 0 ? -0.01 : 0.01;
    const MarkerMotion at = motion.At(row, 0, shift_s);
    const double error_px = (at.centre_px - Fast(row * kPeriod_s + shift_s)).norm();
    EXPECT_LT(error_px, 5 * std::sqrt(at.covariance_px2.trace())) << row;
    EXPECT_LT(error_px, 3) << row;
  }
}

TEST(ImageMotionEdge, DoesNotReachOverAGap) {
  AlignedTrack track = TrackOf(Line, 40);
  // After a pause of 5 periods the marker is somewhere else and moves another way.
  for (int row = 20; row < 40; ++row) {
    EditRow(&track, static_cast<size_t>(row), [row](Observation& observation) {
      observation.time_ns += 100'000'000;
      observation.markers[0].centre_px = {900 - 5.0 * row, 700 + 2.0 * row};
    });
  }
  const ImageMotion motion(track, 1);
  EXPECT_LT((motion.At(19, 0, 0.005).velocity_px_s - Eigen::Vector2d(300, -100)).norm(), 1e-3);
  EXPECT_LT((motion.At(20, 0, 0.005).velocity_px_s - Eigen::Vector2d(-250, 100)).norm(), 1e-3);
}

TEST(ImageMotionEdge, GoesOnOverASingleDropout) {
  AlignedTrack track = TrackOf(Fast, 60);
  for (const int row : {29, 32}) Hide(&track, row);
  const ImageMotion motion(track, 1);
  EXPECT_LT((motion.At(30, 0, 0.01).centre_px - Fast(30 * kPeriod_s + 0.01)).norm(), 0.4);
}

TEST(ImageMotionEdge, RowsWithoutMarkersTakeNoPart) {
  AlignedTrack track = TrackOf(Line, 40);
  for (const size_t row : {19, 22}) {
    EditRow(&track, row, [](Observation& observation) { observation.markers.clear(); });
  }
  const ImageMotion motion(track, 1);
  EXPECT_LT((motion.At(20, 0, 0.01).centre_px - Line(20 * kPeriod_s + 0.01)).norm(), 1e-6);
}

TEST(ImageMotionEdge, AnExcludedRowLeavesItsNeighboursAlone) {
  AlignedTrack track = TrackOf(Line, 40);
  EditMarker(&track, 21, [](MarkerObservation& marker) {
    marker.centre_px += Eigen::Vector2d(8, 0);  // too little to be an outlier
  });
  ImageMotion motion(track, 1);
  const Eigen::Vector2d truth = Line(20 * kPeriod_s + 0.01);
  EXPECT_GT((motion.At(20, 0, 0.01).centre_px - truth).norm(), 1);
  motion.Exclude(21, 0);
  EXPECT_LT((motion.At(20, 0, 0.01).centre_px - truth).norm(), 1e-6);
  // It still moves, from where it was measured.
  EXPECT_LT((motion.At(21, 0, 0.01).centre_px - Line(21 * kPeriod_s + 0.01)).norm(), 8.001);
  Hide(&track, 5);
  ImageMotion with_dropout(track, 1);
  with_dropout.Exclude(5, 0);  // not visible: nothing to take out
  EXPECT_LT((with_dropout.At(4, 0, 0.01).centre_px - Line(4 * kPeriod_s + 0.01)).norm(), 1e-6);
}

// Markers may carry times of their own, and two rows' may meet.
TEST(ImageMotionEdge, RowsAtOneTimeGiveFiniteValues) {
  AlignedTrack track = TrackOf(Line, 40);
  EditMarker(&track, 20, [](MarkerObservation& marker) {
    marker.time_delta_ns = 20'000'000;  // as row 21
    marker.centre_px = Line(21 * kPeriod_s);
  });
  const ImageMotion motion(track, 1);
  for (int row = 16; row < 26; ++row) {
    const MarkerMotion at = motion.At(row, 0, 0.01);
    EXPECT_TRUE(at.centre_px.allFinite() && at.velocity_px_s.allFinite() &&
                at.covariance_px2.allFinite())
        << row;
    const double time_s = (row == 20 ? 21 : row) * kPeriod_s + 0.01;
    EXPECT_LT((at.centre_px - Line(time_s)).norm(), 1e-3) << row;
  }
}

TEST(ImageMotionEdge, OnlyRowsAtOneTimeGiveFiniteValues) {
  AlignedTrack track = TrackOf(Line, 3);
  for (int row = 0; row < 3; ++row) {
    EditMarker(&track, row, [row](MarkerObservation& marker) {
      marker.time_delta_ns = (2 - row) * 20'000'000;
      marker.centre_px = {100 + 0.1 * row, 200};
    });
  }
  const ImageMotion motion(track, 1);
  for (int row = 0; row < 3; ++row) {
    const MarkerMotion at = motion.At(row, 0, 0.01);
    EXPECT_LT((at.centre_px - Eigen::Vector2d(100, 200)).norm(), 50) << row;
    EXPECT_TRUE(at.velocity_px_s.allFinite() && at.covariance_px2.allFinite()) << row;
  }
}

// ---- outlying centres ----

std::vector<int64_t> Times(size_t count) {
  std::vector<int64_t> times_ns;
  for (size_t i = 0; i < count; ++i) times_ns.push_back(static_cast<int64_t>(i) * 20'000'000);
  return times_ns;
}

std::vector<Eigen::Vector2d> Centres(const Path& path, size_t count) {
  std::vector<Eigen::Vector2d> centres_px;
  for (size_t i = 0; i < count; ++i) centres_px.push_back(path(static_cast<double>(i) * kPeriod_s));
  return centres_px;
}

TEST(FindOutlierCentres, OfNothingIsNothing) { EXPECT_TRUE(FindOutlierCentres({}, {}, 1).empty()); }

TEST(FindOutlierCentres, FindsTheOneThatJumps) {
  std::vector<Eigen::Vector2d> centres_px = Centres(Fast, 60);
  centres_px[30].x() += 400;
  centres_px[45].y() -= 400;
  const std::vector<bool> outlier = FindOutlierCentres(Times(60), centres_px, 0.07);
  for (size_t i = 0; i < 60; ++i) EXPECT_EQ(outlier[i], i == 30 || i == 45) << i;
}

TEST(FindOutlierCentres, BelievesFewerThanThreeNeighbours) {
  std::vector<Eigen::Vector2d> centres_px = Centres(Line, 3);
  centres_px[1].x() += 500;
  const std::vector<bool> three = FindOutlierCentres(Times(3), centres_px, 0.07);
  EXPECT_EQ(three, std::vector<bool>(3, false));
  // Neighbours beyond a gap are none.
  centres_px = Centres(Line, 30);
  centres_px[10].x() += 500;
  EXPECT_EQ(FindOutlierCentres(Times(30), centres_px, 0.01), std::vector<bool>(30, false));
}

TEST(FindOutlierCentres, AJumpOfTheWholePathIsNotWild) {
  std::vector<Eigen::Vector2d> centres_px = Centres(Line, 40);
  std::vector<int64_t> times_ns = Times(40);
  for (size_t i = 20; i < 40; ++i) {
    centres_px[i] += Eigen::Vector2d(300, 300);
    times_ns[i] += 1'000'000'000;
  }
  EXPECT_EQ(FindOutlierCentres(times_ns, centres_px, 0.07), std::vector<bool>(40, false));
}

TEST(FindOutlierCentres, TimesThatCoincideDoNotMakeTheOthersWild) {
  std::vector<int64_t> times_ns = Times(40);
  times_ns[20] = times_ns[21];
  std::vector<Eigen::Vector2d> centres_px = Centres(Line, 40);
  centres_px[20] = centres_px[21];
  EXPECT_EQ(FindOutlierCentres(times_ns, centres_px, 0.07), std::vector<bool>(40, false));
  centres_px[10].x() += 200;
  const std::vector<bool> outlier = FindOutlierCentres(times_ns, centres_px, 0.07);
  for (size_t i = 0; i < 40; ++i) EXPECT_EQ(outlier[i], i == 10) << i;
}

}  // namespace
}  // namespace rigcal::server::image_motion_edge_test
