// SPDX-License-Identifier: Apache-2.0
// The general path: rigid targets, alone and beside a wand.
#include <ceres/autodiff_cost_function.h>
#include <ceres/manifold.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <vector>

#include "server/solve/bundle/bundle_adjuster.h"
#include "server/solve/bundle/bundle_information.h"
#include "server/solve/bundle/bundle_path.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/bundle/rigid_marker_cost.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::rigid_bundle_test {
namespace {

using ::rigcal::testing::BundleScene;
using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::SmallBundleScene;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TightTolerances;
using ::testing::HasSubstr;

BundleSceneOptions RigidScene(int every) {
  BundleSceneOptions options = SmallBundleScene();
  options.points_m = {{0, 0, 0}, {0.2, 0, 0.01}, {0, 0.15, 0}, {0.2, 0.15, 0.1}, {0.1, -0.1, 0.05}};
  options.rigid_every = every;
  return options;
}

double WorstPosition(const BundleProblem& a, const BundleProblem& b) {
  double worst = 0;
  for (size_t c = 0; c < a.cameras.size(); ++c) {
    worst = std::max(
        worst,
        (a.cameras[c].cam_from_rig.translation_m - b.cameras[c].cam_from_rig.translation_m).norm());
  }
  return worst;
}

double WorstTurn(const BundleProblem& a, const BundleProblem& b) {
  double worst = 0;
  for (size_t i = 0; i < a.instants.size(); ++i) {
    worst = std::max(worst, Eigen::Quaterniond(a.instants[i].rotation)
                                .angularDistance(Eigen::Quaterniond(b.instants[i].rotation)));
  }
  return worst;
}

TEST(RigidMarkerCost, HasTheDerivativesOfAutomaticDifferentiation) {
  const double turn[4] = {0.1, -0.2, 0.3, std::sqrt(1 - 0.14)}, translation[3] = {0.1, 0.2, 3};
  const double intrinsics[9] = {1250, 1240, 640, 500, -0.22, 0.14, 0.0011, -0.0007, -0.05};
  const double offset = 0.003, rate = 2e-5, line_delay = 1.5e-5, point[3] = {0.11, -0.07, 0.03};
  const double target[7] = {0.5, 0.5, -0.5, 0.5, 0.2, -0.1, 0.4};
  const double* const parameters[] = {turn,  translation, intrinsics, &offset,
                                      &rate, &line_delay, point,      target};
  BundleMarker marker;
  marker.centre_px = {650, 420};
  marker.velocity_px_s = {300, -120};
  marker.sqrt_information << 2, 0.3, 0, 1.7;
  BundleCamera camera;
  camera.middle_row = 511.5;
  const RigidMarkerCost analytic(camera, marker, 12.5);
  const ceres::AutoDiffCostFunction<RigidMarkerFunctor, 2, 4, 3, 9, 1, 1, 1, 3, 7> automatic(
      new RigidMarkerFunctor{{DistortionModel::kBrownConrady, ToMeasured(marker), 12.5, 511.5}});
  const auto evaluate = [&](const ceres::CostFunction& cost) {
    std::vector<Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>> jacobians;
    std::vector<double*> pointers;
    Eigen::Vector2d residual;
    for (const int size : cost.parameter_block_sizes()) jacobians.emplace_back(2, size);
    for (auto& jacobian : jacobians) pointers.push_back(jacobian.data());
    EXPECT_TRUE(cost.Evaluate(parameters, residual.data(), pointers.data()));
    jacobians.emplace_back(residual);
    return jacobians;
  };
  auto mine = evaluate(analytic), theirs = evaluate(automatic);
  // Quaternions are compared along the unit sphere, where they stay.
  const ceres::EigenQuaternionManifold quaternion;
  for (const size_t block : {size_t{0}, size_t{7}}) {
    Eigen::Matrix<double, 4, 3, Eigen::RowMajor> plus;
    quaternion.PlusJacobian(parameters[block], plus.data());
    for (auto* jacobians : {&mine, &theirs}) {
      (*jacobians)[block].leftCols<3>() = ((*jacobians)[block].leftCols<4>() * plus).eval();
      (*jacobians)[block].col(3).setZero();
    }
  }
  for (size_t block = 0; block < mine.size(); ++block) {
    EXPECT_LT((mine[block] - theirs[block]).norm(), 1e-9 * (1 + theirs[block].norm())) << block;
  }
}

TEST(RigidBundle, FindsTheExactRigAndTheTargets) {
  for (const int every : {1, 3}) {
    SCOPED_TRACE(every);
    BundleSceneOptions options = RigidScene(every);
    options.noise_px = 0;
    options.free_rates = options.free_spacing = false;
    const BundleScene scene = MakeBundleScene(options);
    BundleProblem solved = scene.initial;
    ASSERT_TRUE(NeedsGeneralPath(solved));
    ASSERT_OK_AND_ASSIGN(const BundleSummary summary, AdjustBundle(TightTolerances(), &solved));
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(WorstPosition(solved, scene.ground_truth), 1e-7);
    EXPECT_LT(WorstTurn(solved, scene.ground_truth), 1e-6);
  }
}

TEST(RigidBundle, EstimatesPointsUnderTheirPriors) {
  BundleSceneOptions options = RigidScene(1);
  options.noise_px = 0;
  options.free_points = true;
  const BundleScene scene = MakeBundleScene(options);
  BundleProblem solved = scene.initial;
  ASSERT_THAT(AdjustBundle(TightTolerances(), &solved), IsOk());
  // Of the distances between points by the true ones, largest less smallest: only the priors hold
  // the scale.
  const auto distortion = [&scene](const BundleProblem& problem) {
    const auto& points = problem.rigid_target.points_m;
    const auto& truth = scene.ground_truth.rigid_target.points_m;
    std::vector<double> ratios;
    for (size_t i = 0; i < points.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        ratios.push_back((points[i] - points[j]).norm() / (truth[i] - truth[j]).norm());
      }
    }
    const auto [smallest, largest] = std::ranges::minmax(ratios);
    return largest - smallest;
  };
  EXPECT_GT(distortion(scene.initial), 0.005);
  EXPECT_LT(distortion(solved), 0.1 * distortion(scene.initial));
}

TEST(RigidBundle, IsRefusedByTheLineKernel) {
  BundleProblem problem = MakeBundleScene(RigidScene(1)).initial;
  EXPECT_THAT(SolveLineBundle({}, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rigid")));
}

TEST(RigidBundle, RefusesAPointWithoutPriorAndARotationThatIsNone) {
  BundleProblem problem = MakeBundleScene(RigidScene(1)).initial;
  problem.instants[3].rotation.coeffs() *= 2;
  EXPECT_THAT(AdjustBundle({}, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("instant 3")));
  problem = MakeBundleScene(RigidScene(1)).initial;
  problem.rigid_target.fixed = false;
  problem.rigid_target.sigma_m.pop_back();
  EXPECT_THAT(AdjustBundle({}, &problem),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("prior")));
}

// What both paths can solve they solve alike.
TEST(GeneralPath, AgreesWithTheLineKernelOnAWand) {
  BundleSceneOptions options = SmallBundleScene();
  options.outlier_share = 0.03;
  options.free_intrinsics = options.free_rates = options.free_spacing = true;
  const BundleScene scene = MakeBundleScene(options);
  BundleProblem by_kernel = scene.initial, by_ceres = scene.initial;
  ASSERT_FALSE(NeedsGeneralPath(scene.initial));
  ASSERT_OK_AND_ASSIGN(const BundleSummary kernel, SolveLineBundle(TightTolerances(), &by_kernel));
  ASSERT_OK_AND_ASSIGN(const BundleSummary ceres, SolveBundle(TightTolerances(), &by_ceres));
  EXPECT_NEAR(kernel.final_cost, ceres.final_cost, 1e-9 * ceres.final_cost);
  EXPECT_LT(WorstPosition(by_kernel, by_ceres), 1e-6);

  ASSERT_OK_AND_ASSIGN(const ReducedInformation mine, ComputeReducedInformation({}, by_kernel));
  ASSERT_OK_AND_ASSIGN(const ReducedInformation general, ComputeGeneralInformation({}, by_kernel));
  ASSERT_EQ(mine.parameters, general.parameters);
  const Eigen::VectorXd scale = mine.information.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (mine.information - general.information) * scale.asDiagonal())
                .cwiseAbs()
                .maxCoeff(),
            1e-9);
}

// All whitened residuals of a problem, and those of the points' priors.
Eigen::VectorXd Residuals(const BundleProblem& problem) {
  std::vector<double> values;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          ASSERT_TRUE(residual);
          const Eigen::Vector2d whitened = marker.sqrt_information * *residual;
          values.push_back(whitened.x());
          values.push_back(whitened.y());
        });
  }
  const BundleRigidTarget& target = problem.rigid_target;
  for (size_t m = 0; m < target.points_m.size(); ++m) {
    for (int i = 0; i < 3; ++i) {
      values.push_back((target.points_m[m][i] - target.given_points_m[m][i]) / target.sigma_m[m]);
    }
  }
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Eigen::Quaterniond Turned(int axis, double angle, const Eigen::Quaterniond& rotation) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(axis)) * rotation;
}

using Change = std::function<void(double, BundleProblem*)>;

// Every free parameter by itself: first those of the reduced system, then the instants' poses.
std::vector<Change> Changes(const std::vector<ReducedParameter>& parameters, size_t instants) {
  std::vector<Change> changes;
  for (const ReducedParameter& parameter : parameters) {
    changes.push_back([parameter](double by, BundleProblem* problem) {
      const auto index = static_cast<size_t>(parameter.index);
      if (parameter.kind == ReducedParameterKind::kTargetPoint) {
        problem->rigid_target.points_m[index][parameter.component] += by;
        return;
      }
      RigidTransform& pose = problem->cameras[index].cam_from_rig;
      if (parameter.kind == ReducedParameterKind::kTranslation) {
        pose.translation_m[parameter.component] += by;
      } else {
        pose.rotation = Turned(parameter.component, by, pose.rotation);
      }
    });
  }
  for (size_t i = 0; i < instants; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      changes.push_back([i, axis](double by, BundleProblem* problem) {
        problem->instants[i].origin_m[axis] += by;
      });
      changes.push_back([i, axis](double by, BundleProblem* problem) {
        BundleInstant& instant = problem->instants[i];
        instant.rotation = Turned(axis, by, Eigen::Quaterniond(instant.rotation));
      });
    }
  }
  return changes;
}

TEST(GeneralInformation, IsTheSchurComplementOfTheNumericHessian) {
  BundleSceneOptions options = RigidScene(1);
  options.instant_count = 4;
  options.free_offsets = false;
  options.free_points = true;
  const BundleProblem problem = MakeBundleScene(options).initial;
  BundleOptions plain;
  plain.robust = false;
  ASSERT_OK_AND_ASSIGN(const ReducedInformation reduced, ComputeGeneralInformation(plain, problem));
  const Eigen::Index size = reduced.information.rows();
  ASSERT_EQ(size, 3 * 6 + 3 * 5);
  const std::vector<Change> changes = Changes(reduced.parameters, problem.instants.size());
  const Eigen::VectorXd residuals = Residuals(problem);
  Eigen::MatrixXd jacobian(residuals.size(), static_cast<Eigen::Index>(changes.size()));
  constexpr double kStep = 1e-6;
  for (size_t i = 0; i < changes.size(); ++i) {
    BundleProblem more = problem, less = problem;
    changes[i](kStep, &more);
    changes[i](-kStep, &less);
    jacobian.col(static_cast<Eigen::Index>(i)) = (Residuals(more) - Residuals(less)) / (2 * kStep);
  }
  const Eigen::MatrixXd hessian = jacobian.transpose() * jacobian;
  const Eigen::Index rest = hessian.rows() - size;
  const Eigen::MatrixXd expected =
      hessian.topLeftCorner(size, size) -
      hessian.topRightCorner(size, rest) *
          hessian.bottomRightCorner(rest, rest).ldlt().solve(hessian.bottomLeftCorner(rest, size));
  const Eigen::VectorXd scale = expected.diagonal().cwiseSqrt().cwiseInverse();
  EXPECT_LT((scale.asDiagonal() * (reduced.information - expected) * scale.asDiagonal())
                .cwiseAbs()
                .maxCoeff(),
            1e-5);
}

}  // namespace
}  // namespace rigcal::server::rigid_bundle_test
