// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/triangulate_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal {
namespace {

using ::testing::HasSubstr;
using testing::RowsOf;
using testing::StatusIs;
using testing::TrueResult;

SimulationOptions Simulation() {
  SimulationOptions simulation;
  simulation.camera_count = 4;
  simulation.duration_s = 6;
  simulation.outlier_share = simulation.dropout_share = 0;
  return simulation;
}

SimulatedWorld World(const SimulationOptions& simulation) {
  Target wand;
  wand.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(simulation, wand);
}

Eigen::Vector3d TruePosition(const SimulatedWorld& world, const TriangulatedPoint& point) {
  return world.MarkerAt(world.WandAt(1e-9 * static_cast<double>(point.rig_time_ns)),
                        static_cast<size_t>(point.marker));
}

double RmsErrorM(const SimulatedWorld& world, const Triangulation& triangulation) {
  double sum = 0;
  for (const TriangulatedPoint& point : triangulation.points) {
    sum += (point.position_m - TruePosition(world, point)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(triangulation.points.size()));
}

Triangulation TrueTriangulation(const SimulatedWorld& world, std::vector<CameraRows> rows,
                                const TriangulationOptions& options = {}) {
  absl::StatusOr<Triangulation> result =
      TriangulateRows(TrueResult(world), std::move(rows), options);
  EXPECT_THAT(result, testing::IsOk());
  return result.ok() ? *std::move(result) : Triangulation();
}

TEST(TriangulateRows, FindsEveryMarkerWhereItIs) {
  SimulationOptions simulation = Simulation();
  simulation.noise_px = 0;
  const SimulatedWorld world = World(simulation);
  const Triangulation triangulation = TrueTriangulation(world, RowsOf(world));
  ASSERT_GT(triangulation.points.size(), 300u);
  // Centres are 64-bit here; clocks are whole nanoseconds.
  EXPECT_LT(RmsErrorM(world, triangulation), 1e-7);
  EXPECT_EQ(triangulation.disagree_count, 0u);
}

TEST(TriangulateRows, AppliesOffsetsRatesAndLineDelays) {
  SimulationOptions simulation = Simulation();
  simulation.noise_px = 0;
  simulation.free_running = true;
  simulation.time_offset_s = {{1, 0.013}, {2, -0.2}};
  simulation.time_rate_ppm = {{1, 80}};
  simulation.line_delay_s = {{0, 15e-6}, {3, -10e-6}};
  const SimulatedWorld world = World(simulation);
  const Triangulation triangulation = TrueTriangulation(world, RowsOf(world));
  ASSERT_GT(triangulation.points.size(), 300u);
  // At 25 Hz interpolation of a wave costs about a millimetre, at its worst; a millisecond of
  // clock error at 1.5 m/s would cost as much in the mean.
  EXPECT_LT(RmsErrorM(world, triangulation), 6e-4);

  CalibrationResult wrong = TrueResult(world);
  wrong.cameras[1].time_offset_s += 0.004;
  TriangulationOptions trusting;
  trusting.max_sigmas = 1e6;
  const auto late = TriangulateRows(wrong, RowsOf(world), trusting);
  ASSERT_THAT(late, testing::IsOk());
  EXPECT_GT(RmsErrorM(world, *late), 1e-3);
}

TEST(TriangulateRows, StatesTheErrorThatNoiseMakes) {
  const SimulatedWorld world = World(Simulation());
  TriangulationOptions options;
  options.sigma_px = 0.3;
  const Triangulation triangulation = TrueTriangulation(world, RowsOf(world), options);
  double normalised = 0;
  for (const TriangulatedPoint& point : triangulation.points) {
    const Eigen::Vector3d error = point.position_m - TruePosition(world, point);
    normalised += error.dot(point.covariance_m2.inverse() * error);
  }
  const auto count = static_cast<double>(triangulation.points.size());
  ASSERT_GT(count, 300);
  // A mean of squares with 3 degrees of freedom each, its own sigma sqrt(6 / count).
  EXPECT_NEAR(normalised / count, 3, 4 * std::sqrt(6 / count));
}

TEST(TriangulateRows, LeavesOutACentreThatDoesNotAgree) {
  const SimulatedWorld world = World(Simulation());
  std::vector<CameraRows> rows = RowsOf(world);
  uint32_t spoilt = 0;
  for (size_t i = 0; i < rows[2].rows.size(); i += 10) {
    for (MarkerObservation& marker : rows[2].rows[i].markers) {
      marker.centre_px += Eigen::Vector2d(30, 20);
      spoilt += marker.visible ? 1 : 0;
    }
  }
  TriangulationOptions options;
  options.sigma_px = 0.3;
  const Triangulation triangulation = TrueTriangulation(world, rows, options);
  ASSERT_GT(spoilt, 10u);
  EXPECT_GT(triangulation.left_out.at("sim_2") + triangulation.disagree_count, spoilt * 9 / 10);
  EXPECT_LT(RmsErrorM(world, triangulation), 2e-3);
}

TEST(TriangulateRows, TwoViewsThatDoNotAgreeAreNoPoint) {
  const SimulatedWorld world = World(Simulation());
  std::vector<CameraRows> rows = RowsOf(world);
  rows.resize(2);
  for (Observation& row : rows[1].rows) {
    for (MarkerObservation& marker : row.markers) marker.centre_px += Eigen::Vector2d(40, 40);
  }
  TriangulationOptions options;
  options.sigma_px = 0.3;
  const Triangulation triangulation = TrueTriangulation(world, rows, options);
  EXPECT_GT(triangulation.disagree_count, 100u);
  EXPECT_LT(triangulation.points.size(), triangulation.disagree_count / 20);
}

TEST(TriangulateRows, TheCovarianceHasTheCalibrationsPart) {
  const SimulatedWorld world = World(Simulation());
  CalibrationResult calibration = TrueResult(world);
  calibration.reference_camera = "sim_0";
  constexpr int kRows = 18;  // three cameras, six each
  calibration.camera_covariance.assign(kRows * (kRows + 1) / 2, 0);
  // The translation of sim_1, 10 mm along each axis.
  for (const int row : {3, 4, 5}) {
    calibration.camera_covariance[static_cast<size_t>(row * (row + 1) / 2 + row)] = 1e-4;
  }
  const auto uncertain = TriangulateRows(calibration, RowsOf(world), {});
  ASSERT_THAT(uncertain, testing::IsOk());
  EXPECT_TRUE(uncertain->has_calibration_covariance);
  bool by_sim_1 = false;
  for (const TriangulatedPoint& point : uncertain->points) {
    const bool seen =
        std::ranges::any_of(point.views, [](const PixelView& view) { return view.camera == 1; });
    const double gained_m2 = (point.covariance_m2 - point.noise_m2).trace();
    if (!seen) {
      EXPECT_EQ(gained_m2, 0);
    }
    if (seen && gained_m2 > 1e-6) by_sim_1 = true;
  }
  EXPECT_TRUE(by_sim_1);
}

TEST(TriangulateRows, RefusesRowsOfACameraThatWasNotCalibrated) {
  const SimulatedWorld world = World(Simulation());
  std::vector<CameraRows> rows = RowsOf(world);
  rows[1].camera = "left";
  EXPECT_THAT(TriangulateRows(TrueResult(world), rows, {}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("no camera left; it has sim_0, sim_1, sim_2, sim_3")));
}

TEST(TriangulateRows, RefusesACalibrationWithoutScale) {
  const SimulatedWorld world = World(Simulation());
  CalibrationResult calibration = TrueResult(world);
  calibration.scale_known = false;
  EXPECT_THAT(TriangulateRows(calibration, RowsOf(world), {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("scale")));
}

}  // namespace
}  // namespace rigcal
