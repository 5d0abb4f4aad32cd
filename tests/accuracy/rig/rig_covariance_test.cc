// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/rig/rig_covariance.h"

#include <cmath>
#include <map>
#include <tuple>

#include "server/solve/calibrate.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy::rig_covariance_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

SimulatedWorld World(const std::string& options) {
  return *SimulatedWorld::Create(*ParseSimulationOptions(options),
                                 *ParseTarget("wand:0,0.13,0.39"));
}

// Errors of three cameras, the reference being 0.
CalibrationErrors ThreeCameras() {
  CalibrationErrors errors;
  for (int c = 0; c < 3; ++c) {
    CameraError camera;
    camera.index = c;
    camera.is_reference = c == 0;
    camera.true_position_m = c * Eigen::Vector3d(1, 2, -1);
    errors.cameras.push_back(camera);
  }
  errors.marker_positions_m = {0, 0};
  return errors;
}

RigCovariance Independent(double sigma) {
  RigCovariance covariance;
  for (const int c : {1, 2}) {
    for (int i = 0; i < 3; ++i) {
      covariance.parameters.push_back({RigParameterKind::kRotation, c, i});
      covariance.parameters.push_back({RigParameterKind::kPosition, c, i});
    }
    covariance.parameters.push_back({RigParameterKind::kTimeOffset, c, 0});
  }
  const auto size = static_cast<Eigen::Index>(covariance.parameters.size());
  covariance.matrix = sigma * sigma * Eigen::MatrixXd::Identity(size, size);
  return covariance;
}

TEST(NormaliseErrors, AScaleErrorIsNoShapeError) {
  CalibrationErrors errors = ThreeCameras();
  for (CameraError& camera : errors.cameras) {
    camera.pose.position_m = 0.01 * camera.true_position_m;
  }
  const RigNees nees = NormaliseErrors(errors, Independent(0.1));
  EXPECT_EQ(nees.shape.dof, 11);
  EXPECT_NEAR(nees.shape.value, 0, 1e-12);
  EXPECT_EQ(nees.scale.dof, 1);
  // Variance of the scale: 0.1^2 / (6 + 24).
  EXPECT_NEAR(nees.scale.value, 1e-4 / (0.01 / 30), 1e-9);
}

TEST(NormaliseErrors, AShapeErrorIsNoScaleErrorAndTimesAreAgainstTheReference) {
  CalibrationErrors errors = ThreeCameras();
  errors.cameras[1].pose.rotation_rad = {0.1, 0.2, 0};
  errors.cameras[2].pose.position_m = {2, -1, 0};  // across the line to the camera
  errors.cameras[0].time_offset_s = 0.1;
  errors.cameras[2].time_offset_s = -0.1;
  const RigNees nees = NormaliseErrors(errors, Independent(0.1));
  EXPECT_NEAR(nees.scale.value, 0, 1e-12);
  EXPECT_NEAR(nees.shape.value, (0.05 + 5) / 0.01, 1e-9);
  EXPECT_EQ(nees.time_offsets.dof, 2);
  EXPECT_NEAR(nees.time_offsets.value, (0.01 + 0.04) / 0.01, 1e-9);
  EXPECT_EQ(nees.time_rates.dof, 0);
  EXPECT_EQ(nees.intrinsics.dof, 0);
}

// The solver's information at its estimates and the bound at the ground truth are computed from
// different derivatives and in different parameters. The robust loss at two sigmas costs 9 % of
// variance over Gaussian noise, and the solver scales by its own residuals.
TEST(FromSolution, IsTheBoundUpToTheRobustLoss) {
  const SimulatedWorld world =
      World("seed=6;cameras=4;duration=20;outliers=0;offset.1=0.002;offset.3=-0.001");
  CalibrationOptions options;
  options.intrinsics = Estimate::kFixed;
  options.time_offsets = options.marker_positions = Estimate::kRefined;
  absl::StatusOr<RigCovariance> stated = absl::UnknownError("not called");
  server::CalibrationHooks hooks;
  hooks.solved = [&](const server::RigObservations&, const server::RigSolution& solution) {
    stated = FromSolution(world, solution, SolverCovariance::kOfNoise);
  };
  ASSERT_THAT(server::Calibrate(server::InputOf(world), options, hooks).result, IsOk());
  ASSERT_THAT(stated, IsOk());

  InformationOptions information;
  information.marker_positions = information.time_offsets = true;
  information.span_sigma_m = world.target().span_tolerance_m;
  ASSERT_OK_AND_ASSIGN(const RigBound bound, ComputeRigBound(MakeTrueRig(world, 0), information));
  const RigCovariance expected = FromBound(bound, information);
  using Key = std::tuple<RigParameterKind, int, int>;
  std::map<Key, double> variance;
  for (size_t i = 0; i < expected.parameters.size(); ++i) {
    const RigParameter& p = expected.parameters[i];
    const auto at = static_cast<Eigen::Index>(i);
    variance[{p.kind, p.camera, p.component}] = expected.matrix(at, at);
  }
  ASSERT_EQ(stated->parameters.size(), expected.parameters.size());
  std::vector<double> ratios;
  for (size_t i = 0; i < stated->parameters.size(); ++i) {
    const RigParameter& p = stated->parameters[i];
    const auto at = static_cast<Eigen::Index>(i);
    ASSERT_TRUE(variance.contains({p.kind, p.camera, p.component}));
    ratios.push_back(std::sqrt(stated->matrix(at, at) / variance[{p.kind, p.camera, p.component}]));
    EXPECT_GT(ratios.back(), 0.95) << i;
    EXPECT_LT(ratios.back(), 1.15) << i;
  }
}

}  // namespace
}  // namespace rigcal::accuracy::rig_covariance_test
