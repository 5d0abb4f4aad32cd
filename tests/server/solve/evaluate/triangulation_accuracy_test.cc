// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/triangulation_accuracy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/camera/camera_model.h"
#include "server/solve/calibrate.h"
#include "server/solve/geometry/triangulation.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::triangulation_accuracy_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

SimulatedWorld World(const std::string& options) {
  const auto parsed = ParseSimulationOptions(options);
  EXPECT_THAT(parsed, IsOk());
  auto world = SimulatedWorld::Create(*parsed, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

CalibrationResult Solve(const SimulatedWorld& world, Estimate intrinsics, Estimate positions) {
  CalibrationOptions options;
  options.intrinsics = intrinsics;
  options.marker_positions = positions;
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  EXPECT_THAT(outcome.result, IsOk());
  return *outcome.result;
}

// Sums of squares of actual and of expected errors.
struct Sums {
  double actual = 0, expected = 0, expected_of_shape = 0;
  int count = 0;
};

// Triangulates points where the wand was, from noisy views of the true cameras, with the
// calibration, in the frame of the reference camera.
void Compare(const SimulatedWorld& world, const CalibrationResult& result, uint32_t seed,
             Sums* sums) {
  constexpr double kSigmaPx = 0.3;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kSigmaPx);
  std::uniform_real_distribution<double> when(1, world.options().duration_s - 1);
  const RigidTransform reference_from_world = world.cameras()[0].cam_from_rig;
  ASSERT_EQ(result.reference_camera, "sim_0");
  AccuracyOptions options;
  options.sigma_px = kSigmaPx;
  std::vector<Eigen::Vector3d> triangulated;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d x_in_world = world.WandAt(when(random)).origin_m;
    std::vector<CameraRay> views;
    for (size_t c = 0; c < world.cameras().size(); ++c) {
      const SimulatedCamera& camera = world.cameras()[c];
      Eigen::Vector2d pixel;
      if (!Project(camera.true_intrinsics, camera.cam_from_rig * x_in_world, &pixel)) continue;
      const ImageSize& size = camera.description.image_size_px;
      // Well inside, so that those who foretell count the same cameras.
      if (pixel.x() < 5 || pixel.y() < 5 || pixel.x() > size.width - 6.0 ||
          pixel.y() > size.height - 6.0) {
        continue;
      }
      pixel += Eigen::Vector2d(noise(random), noise(random));
      const auto ray = Undistort(result.cameras[c].intrinsics, pixel);
      ASSERT_THAT(ray, IsOk());
      views.push_back({result.cameras[c].cam_from_rig, *ray});
    }
    const auto x_in_rig = Triangulate(views);
    if (views.size() < 3 || !x_in_rig) continue;
    options.points_m = {reference_from_world * x_in_world};
    ASSERT_OK_AND_ASSIGN(const Accuracy accuracy, ComputeAccuracy(result, options));
    if (accuracy.points[0].camera_count != views.size()) continue;
    sums->actual += (*x_in_rig - options.points_m[0]).squaredNorm();
    sums->expected += accuracy.points[0].sigma_m.squaredNorm();
    sums->expected_of_shape += accuracy.points[0].shape_sigma_m.squaredNorm();
    ++sums->count;
  }
}

TEST(TriangulationAccuracy, IsWhatSimulatedPointsShow) {
  // Few instants, so that the calibration's part of the error counts; no scale error.
  Sums sums;
  for (uint32_t seed = 1; seed <= 60; ++seed) {
    const SimulatedWorld world =
        World(absl::StrCat("cameras=4;duration=12;rate=10;outliers=0;seed=", seed));
    const CalibrationResult result = Solve(world, Estimate::kFixed, Estimate::kFixed);
    Compare(world, result, seed, &sums);
  }
  ASSERT_GT(sums.count, 1000);
  const double ratio = std::sqrt(sums.actual / sums.expected_of_shape);
  RecordProperty("ratio", absl::StrCat(ratio));
  EXPECT_NEAR(ratio, 1, 0.15);
}

TEST(TriangulationAccuracy, CountsRefinedIntrinsicsAndTheScale) {
  // The ground truth drawn from what the solver takes for its priors.
  Sums sums;
  for (uint32_t seed = 1; seed <= 60; ++seed) {
    const SimulatedWorld world = World(absl::StrCat(
        "cameras=4;duration=20;rate=10;outliers=0;length_sigma=0.002;focal_sigma=0.02;"
        "centre_sigma=12.8;radial_sigma=0.05;radial_high_sigma=0.1;tangential_sigma=0.002;seed=",
        seed));
    const CalibrationResult result = Solve(world, Estimate::kRefined, Estimate::kRefined);
    Compare(world, result, seed, &sums);
  }
  ASSERT_GT(sums.count, 1000);
  const double ratio = std::sqrt(sums.actual / sums.expected);
  RecordProperty("ratio", absl::StrCat(ratio));
  EXPECT_NEAR(ratio, 1, 0.15);
  EXPECT_LT(sums.expected_of_shape, sums.expected);
}

TEST(TriangulationAccuracy, GridCoversTheVolumeOfTheWand) {
  const SimulatedWorld world = World("cameras=4;duration=12;rate=10;seed=3");
  const CalibrationResult result = Solve(world, Estimate::kFixed, Estimate::kRefined);
  ASSERT_OK_AND_ASSIGN(const Accuracy accuracy, ComputeAccuracy(result, {}));
  EXPECT_GT(accuracy.grid.size(), 100u);
  EXPECT_GT(accuracy.grid_step_m, 0);
  EXPECT_TRUE(accuracy.points.empty());
  EXPECT_EQ(accuracy.shape.count, accuracy.grid.size());
  ASSERT_TRUE(result.wand_volume.has_value());
  for (const PointAccuracy& point : accuracy.grid) {
    EXPECT_TRUE((point.point_m.array() >= result.wand_volume->min_m.array()).all());
    EXPECT_TRUE((point.point_m.array() <= result.wand_volume->max_m.array()).all());
    EXPECT_GE(point.camera_count, 2u);
    EXPECT_GT(point.noise_sigma_m.minCoeff(), 0);
    EXPECT_GE(point.shape_sigma_m.norm(), point.noise_sigma_m.norm());
    EXPECT_GE(point.sigma_m.norm(), point.shape_sigma_m.norm());
    EXPECT_LE(point.shape_sigma_m.norm(), accuracy.shape.worst_m);
  }
  EXPECT_LE(accuracy.shape.median_m, accuracy.shape.p95_m);
  EXPECT_LE(accuracy.shape.p95_m, accuracy.shape.worst_m);
  EXPECT_GT(accuracy.with_scale.median_m, accuracy.shape.median_m);
}

TEST(TriangulationAccuracy, SaysWhereNobodySees) {
  const SimulatedWorld world = World("cameras=3;duration=12;rate=10;seed=3");
  const CalibrationResult result = Solve(world, Estimate::kFixed, Estimate::kFixed);
  AccuracyOptions options;
  options.points_m = {{0, 0, -5}, 0.5 * (result.wand_volume->min_m + result.wand_volume->max_m)};
  ASSERT_OK_AND_ASSIGN(const Accuracy accuracy, ComputeAccuracy(result, options));
  ASSERT_EQ(accuracy.points.size(), 2u);
  EXPECT_LT(accuracy.points[0].camera_count, 2u);
  EXPECT_EQ(accuracy.points[0].sigma_m.norm(), 0);
  EXPECT_GE(accuracy.points[1].camera_count, 2u);
  EXPECT_EQ(accuracy.shape.count, 1u);
  EXPECT_TRUE(accuracy.grid.empty());
}

// The same points are asked of the rig in two frames: that of the first camera, and that of the
// third, which has seen little, so that its own pose is loose.
TEST(TriangulationAccuracy, ThePartOfTheCalibrationDoesNotDependOnTheFrame) {
  const SimulatedWorld world = World("cameras=4;duration=20;rate=20;seed=11");
  CalibrationInput input = InputOf(world);
  const std::string loose = world.cameras()[2].description.camera;
  for (CameraTrack& track : input.tracks) {
    if (track.camera.camera == loose) {
      int row = 0;
      std::erase_if(track.observations, [&](const Observation&) { return row++ % 16 != 0; });
    }
  }
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  double calibration_p95_m[2], shape_p95_m[2];
  std::vector<double> by_point_m[2];
  for (const int c : {0, 1}) {
    const size_t reference = c == 0 ? 0 : 2;
    options.reference_camera = world.cameras()[reference].description.camera;
    const CalibrationOutcome outcome = Calibrate(input, options);
    ASSERT_THAT(outcome.result, IsOk());
    AccuracyOptions asked;
    asked.sigma_px = 1e-3;
    for (double time_s = 0.5; time_s < 20; time_s += 0.1) {
      asked.points_m.push_back(world.cameras()[reference].cam_from_rig *
                               world.WandAt(time_s).origin_m);
    }
    ASSERT_OK_AND_ASSIGN(const Accuracy accuracy, ComputeAccuracy(*outcome.result, asked));
    calibration_p95_m[c] = accuracy.calibration_p95_m;
    shape_p95_m[c] = accuracy.shape.p95_m;
    double squares = 0;
    for (const PointAccuracy& point : accuracy.points) {
      by_point_m[c].push_back(point.calibration_sigma_m);
      squares += point.calibration_sigma_m * point.calibration_sigma_m;
    }
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(accuracy.points.size())),
                accuracy.calibration_rms_m, 1e-9);
  }
  ASSERT_EQ(by_point_m[0].size(), by_point_m[1].size());
  for (size_t i = 0; i < by_point_m[0].size(); ++i) {
    EXPECT_NEAR(by_point_m[1][i] / by_point_m[0][i], 1, 0.02) << i;
  }
  EXPECT_GT(shape_p95_m[1], 1.3 * shape_p95_m[0]) << "the frame made no difference";
  // The draws are others: sampling moves a percentile of 64 by a few per cent.
  EXPECT_NEAR(calibration_p95_m[1] / calibration_p95_m[0], 1, 0.1);
  EXPECT_GT(calibration_p95_m[0], 1e-5);
}

TEST(TriangulationAccuracy, RefusesWhatItCannotAnswer) {
  const SimulatedWorld world = World("cameras=3;duration=12;rate=10;seed=3");
  CalibrationResult result = Solve(world, Estimate::kFixed, Estimate::kFixed);
  for (const double wrong : std::vector<double>{0, -1, NAN, INFINITY}) {
    AccuracyOptions options;
    options.sigma_px = wrong;
    EXPECT_THAT(ComputeAccuracy(result, options),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("sigma_px")));
  }
  AccuracyOptions options;
  options.points_m = {{0, NAN, 1}};
  EXPECT_THAT(ComputeAccuracy(result, options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("points_m[0]")));
  options.points_m.clear();
  options.grid_step_m = 1e-4;
  EXPECT_THAT(ComputeAccuracy(result, options),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("wider")));
  result.wand_volume.reset();
  EXPECT_THAT(ComputeAccuracy(result, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("points")));
  result.camera_covariance.pop_back();
  EXPECT_THAT(ComputeAccuracy(result, {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("covariance")));
}

}  // namespace
}  // namespace rigcal::server::triangulation_accuracy_test
