// SPDX-License-Identifier: Apache-2.0
#include "server/solve/diagnose/move_scan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <vector>

#include "common/camera/camera_model.h"
#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::move_scan_test {
namespace {

constexpr int kInstants = 200;
constexpr int64_t kStepNs = 100'000'000;
constexpr int kMovedFrom = 130;  // instant
const PoseStep& Move() {
  static const auto* const kMove = new PoseStep{{0.002, -0.003, 0.001, 0.004, 0.002, -0.003}};
  return *kMove;
}

// Two cameras; the second moves, until it is back, and its pose is as it was before. By a pixel to
// and fro, the target's poses are not what is wrong.
TrialProblem Trial(bool moves, int until = kInstants) {
  std::vector<ExactWand> wands;
  for (int i = 0; i < kInstants; ++i) {
    const double t = 0.1 * i;
    wands.push_back(
        {{0.5 + 0.4 * std::sin(t), 0.3 * std::cos(1.7 * t), 3 + 0.5 * std::sin(0.6 * t)},
         {std::cos(t), std::sin(t), 0.3}});
  }
  TrialProblem trial;
  trial.problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, wands);
  trial.rig_camera = {0, 1};
  BundleProblem& problem = trial.problem;
  const BundleCamera& camera = problem.cameras[1];
  RigidTransform moved = camera.cam_from_rig;
  const Eigen::Vector3d turn = Move().head<3>();
  moved.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * moved.rotation;
  moved.translation_m += Move().tail<3>();
  for (int i = 0; i < kInstants; ++i) {
    trial.instant_time_ns.push_back(i * kStepNs);
    if (!moves || i < kMovedFrom || i >= until) continue;
    const BundleInstant& instant = problem.instants[static_cast<size_t>(i)];
    const BundleObservation& observation = problem.ObservationsOf(instant)[1];
    for (BundleMarker& marker : problem.MarkersOf(observation)) {
      Eigen::Vector2d pixel;
      EXPECT_TRUE(Project(camera.model, camera.intrinsics.data(),
                          moved * problem.PointOf(instant, marker), &pixel, nullptr, nullptr));
      marker.centre_px = pixel;
    }
  }
  for (size_t m = 0; m < problem.markers.size(); ++m) {
    problem.markers[m].centre_px.x() += 0.1 * std::sin(7.0 * static_cast<double>(m));
  }
  return trial;
}

TEST(MoveScanTest, FindsWhenACameraMovedAndHow) {
  const TrialProblem trial = Trial(true);
  const SessionTimeline timeline(trial, {{}});
  const auto found = ScanForMove(trial, timeline, 1);
  ASSERT_TRUE(found.has_value());
  EXPECT_LE(std::abs(found->time_ns - kMovedFrom * kStepNs), 2 * kStepNs);
  EXPECT_FALSE(found->IsBack());
  EXPECT_GT(found->gain, 0.8);
  EXPECT_LT(found->before.norm(), 2e-4);
  EXPECT_LT((found->after - Move()).norm(), 5e-4);
  EXPECT_TRUE(HoldsForOtherTimes(trial, timeline, 1, *found));
  // 1000 px times some milliradians.
  const double error_px = LargestErrorPx(trial, timeline, 1, *found);
  EXPECT_GT(error_px, 1);
  EXPECT_LT(error_px, 8);
}

TEST(MoveScanTest, FindsACameraThatMovedThereAndBack) {
  const int back = kMovedFrom + 40;
  const TrialProblem trial = Trial(true, back);
  const SessionTimeline timeline(trial, {{}});
  const auto found = ScanForMove(trial, timeline, 1);
  ASSERT_TRUE(found.has_value());
  ASSERT_TRUE(found->IsBack());
  EXPECT_LE(std::abs(found->time_ns - kMovedFrom * kStepNs), 2 * kStepNs);
  EXPECT_LE(std::abs(found->until_ns - back * kStepNs), 2 * kStepNs);
  EXPECT_GT(found->gain, 0.8);
  EXPECT_LT(found->before.norm(), 2e-4);
  EXPECT_LT((found->after - Move()).norm(), 5e-4);
  EXPECT_TRUE(HoldsForOtherTimes(trial, timeline, 1, *found));
  EXPECT_GT(LargestErrorPx(trial, timeline, 1, *found), 1);
}

TEST(MoveScanTest, FindsNothingInACameraThatStandsStill) {
  const TrialProblem trial = Trial(false);
  const SessionTimeline timeline(trial, {{}});
  for (const int camera : {0, 1}) {
    const auto found = ScanForMove(trial, timeline, camera);
    if (!found) continue;
    EXPECT_LT(found->gain, kMinScanGain);
    EXPECT_FALSE(HoldsForOtherTimes(trial, timeline, camera, *found));
  }
}

TEST(MoveScanTest, AsksForEnoughMarkers) {
  TrialProblem trial = Trial(true);
  for (size_t i = 0; i < trial.problem.instants.size(); ++i) {
    trial.problem.instants[i].used = i % 4 == 0;
  }
  const SessionTimeline timeline(trial, {{}});
  EXPECT_FALSE(ScanForMove(trial, timeline, 1).has_value());
}

}  // namespace
}  // namespace rigcal::server::move_scan_test
