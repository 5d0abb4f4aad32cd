// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::uncertainty_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

SimulatedWorld World(const std::string& options) {
  auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

CalibrationResult Solve(const SimulatedWorld& world, const CalibrationOptions& options = {}) {
  const CalibrationOutcome outcome = Calibrate(InputOf(world), options);
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *outcome.result : CalibrationResult{};
}

TEST(Uncertainty, IsOfTheSizeOfTheErrors) {
  // Baselines seen in the reference camera's frame, against the ground truth; over all cameras,
  // axes and seeds the mean square of normalised errors is 1, and of 60 of them its standard
  // deviation 0.18.
  double sum = 0;
  int count = 0;
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  options.marker_positions = Estimate::kFixed;
  for (const int seed : {1, 2, 3, 4}) {
    const SimulatedWorld world = World("cameras=6;duration=20;seed=" + std::to_string(seed));
    const CalibrationResult result = Solve(world, options);
    ASSERT_EQ(result.cameras.size(), 6u);
    const RigidTransform reference_from_world = world.cameras()[0].cam_from_rig;
    for (size_t c = 1; c < 6; ++c) {
      const Eigen::Vector3d truth =
          reference_from_world * world.cameras()[c].cam_from_rig.SourceFromTargetTranslation();
      const Eigen::Vector3d error =
          result.cameras[c].cam_from_rig.SourceFromTargetTranslation() - truth;
      ASSERT_TRUE(result.cameras[c].uncertainty.has_value());
      const Eigen::Vector3d sigma = result.cameras[c].uncertainty->position_sigma_m;
      sum += error.cwiseQuotient(sigma).squaredNorm();
      count += 3;
    }
    EXPECT_TRUE(result.cameras[0].uncertainty->position_sigma_m.isZero());
  }
  // Cameras share the reference's errors, so that there are fewer than 60 of them: wide limits.
  EXPECT_GT(sum / count, 0.4);
  EXPECT_LT(sum / count, 2.2);
}

TEST(Uncertainty, FollowsTheResidualsNotTheStatedSigma) {
  const SimulatedWorld world = World("cameras=4;duration=20;outliers=0");
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  const CalibrationResult stated = Solve(world, options);
  options.sigma_px = 0.9;
  const CalibrationResult overstated = Solve(world, options);
  const double a = stated.cameras[1].uncertainty->position_sigma_m.norm();
  const double b = overstated.cameras[1].uncertainty->position_sigma_m.norm();
  EXPECT_NEAR(b / a, 1, 0.15);
}

// Variance factor of the Cauchy loss at 2 sigmas under normal errors, by integration over s = |e|^2
// of density exp(-s / 2) / 2, is 1.0919 of variance, whatever share of the errors the fit takes.
TEST(Uncertainty, LossCostsWhatItMust) {
  for (const char* cameras : {"2", "6"}) {
    const SimulatedWorld world =
        World(std::string("cameras=") + cameras + ";duration=120;outliers=0;seed=5");
    CalibrationOptions options;
    options.intrinsics = options.time_offsets = options.marker_positions = Estimate::kFixed;
    CalibrationHooks hooks;
    int calls = 0;
    hooks.solved = [&](const RigObservations&, const RigSolution& solution) {
      ++calls;
      ASSERT_OK_AND_ASSIGN(const RigUncertainty stated, ComputeUncertainty(solution, {}));
      BundleOptions without_loss;
      without_loss.robust = false;
      ASSERT_OK_AND_ASSIGN(const ReducedInformation information,
                           ComputeReducedInformation(without_loss, solution.built.problem));
      const Eigen::MatrixXd bound = information.information.inverse();
      const double ratio = stated.covariance.diagonal().cwiseQuotient(bound.diagonal()).mean();
      EXPECT_NEAR(ratio, 1.0919, 0.03) << cameras << " cameras";
    };
    EXPECT_THAT(Calibrate(InputOf(world), options, hooks).result, IsOk());
    EXPECT_EQ(calls, 1);
  }
}

TEST(Uncertainty, ScaleIsThatOfTheTargetAndApartFromTheShape) {
  CalibrationInput input = InputOf(World("cameras=4;duration=20"));
  input.target.span_tolerance_m = 0.004;
  const CalibrationOutcome loose = Calibrate(input, {});
  input.target.span_tolerance_m = 0.001;
  const CalibrationOutcome tight = Calibrate(input, {});
  ASSERT_THAT(loose.result, IsOk());
  ASSERT_THAT(tight.result, IsOk());
  EXPECT_NEAR(loose.result->target.scale_sigma_rel / tight.result->target.scale_sigma_rel, 4, 0.4);
  EXPECT_NEAR(tight.result->target.scale_sigma_rel, 0.001 * std::sqrt(1.8) / 0.39, 0.001);
  EXPECT_NEAR(loose.result->cameras[2].uncertainty->position_sigma_m.norm() /
                  tight.result->cameras[2].uncertainty->position_sigma_m.norm(),
              1, 0.1);
}

TEST(Uncertainty, MoreDataIsLessUncertain) {
  const CalibrationResult some = Solve(World("cameras=3;duration=15"));
  const CalibrationResult more = Solve(World("cameras=3;duration=60"));
  const double ratio = some.cameras[1].uncertainty->position_sigma_m.norm() /
                       more.cameras[1].uncertainty->position_sigma_m.norm();
  EXPECT_GT(ratio, 1.4);
  EXPECT_LT(ratio, 3.0);
}

TEST(Uncertainty, ARateIsEstimatedOnlyWhereThereIsOne) {
  const CalibrationResult with = Solve(World("cameras=3;duration=60;rate_ppm.1=50"));
  const CalibrationResult without = Solve(World("cameras=3;duration=60"));
  EXPECT_NEAR(with.cameras[1].time_rate_ppm - with.cameras[0].time_rate_ppm, 50, 10);
  EXPECT_GT(with.cameras[1].uncertainty->time_rate_sigma_ppm +
                with.cameras[0].uncertainty->time_rate_sigma_ppm,
            0);
  for (const CalibratedCamera& camera : without.cameras) EXPECT_EQ(camera.time_rate_ppm, 0);
}

}  // namespace
}  // namespace rigcal::server::uncertainty_test
