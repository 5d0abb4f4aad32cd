// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/scale_uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::scale_uncertainty_test {
namespace {

using Kind = ReducedParameterKind;

// Two cameras a metre from each other, of which the second is estimated; a wand.
BundleProblem TwoCameras() { return ExactProblem({{0, 0, 0}, {1, 0, 0}}, {}); }

RigUncertainty OfSecondCamera(double sigma_m) {
  RigUncertainty uncertainty;
  for (int i = 0; i < 3; ++i) uncertainty.parameters.push_back({Kind::kTranslation, 1, i});
  uncertainty.covariance = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  return uncertainty;
}

TEST(ScaleUncertaintyTest, ADistanceIsKnownAsItWasMeasuredNotAsItIsHeld) {
  BundleProblem problem = TwoCameras();
  problem.distance = BundleDistance{0, 1, 1, 1e-5};
  for (const double measured_m : {0.0, 0.003}) {
    RigUncertainty uncertainty = OfSecondCamera(0.001);
    DescribeScale(problem, measured_m, &uncertainty);
    EXPECT_NEAR(uncertainty.scale_sigma_rel, measured_m, 1e-12);
    EXPECT_NEAR(uncertainty.shape_covariance(0, 0), 0, 1e-15);  // along the distance
    EXPECT_NEAR(uncertainty.shape_covariance(1, 1), 1e-6, 1e-15);
    EXPECT_NEAR(uncertainty.covariance(0, 0), measured_m * measured_m, 1e-12);
    EXPECT_NEAR(uncertainty.covariance(1, 1), 1e-6, 1e-15);
  }
}

TEST(ScaleUncertaintyTest, AWandThatIsNotEstimatedIsKnownByItsSpans) {
  BundleProblem problem = TwoCameras();
  problem.target.span_sigma_m = 0.001;
  RigUncertainty uncertainty = OfSecondCamera(0.001);
  const Eigen::MatrixXd before = uncertainty.covariance;
  DescribeScale(problem, 0, &uncertainty);
  EXPECT_NEAR(uncertainty.scale_sigma_rel, std::sqrt(2) * 0.001 / 0.39, 1e-12);
  EXPECT_EQ(uncertainty.covariance, before);
  EXPECT_EQ(uncertainty.shape_covariance, before);  // no parameter knows of the scale
}

TEST(ScaleUncertaintyTest, ALengthThatIsEstimatedIsHeldInTheShape) {
  BundleProblem problem = TwoCameras();
  problem.target.fixed = false;
  RigUncertainty uncertainty = OfSecondCamera(0.001);
  uncertainty.parameters.push_back({Kind::kMarkerPosition, 2, 0});
  // The camera's x is as uncertain as the wand's length makes it, and by 0.5 mm besides.
  Eigen::Matrix4d covariance = 1e-6 * Eigen::Matrix4d::Identity();
  const double length_sigma_m = 0.002, metres_per_length = 1 / 0.39;
  covariance(3, 3) = std::pow(length_sigma_m, 2);
  covariance(0, 3) = covariance(3, 0) = metres_per_length * covariance(3, 3);
  covariance(0, 0) = metres_per_length * covariance(0, 3) + 0.25e-6;
  uncertainty.covariance = covariance;
  DescribeScale(problem, 0, &uncertainty);
  EXPECT_NEAR(uncertainty.scale_sigma_rel, length_sigma_m / 0.39, 1e-12);
  EXPECT_NEAR(uncertainty.shape_covariance(0, 0), 0.25e-6, 1e-12);
  EXPECT_NEAR(uncertainty.shape_covariance(3, 3), 0, 1e-15);
}

// Of two targets the one that is known best says what the scale is.
TEST(ScaleUncertaintyTest, ThePointsOfARigidTargetGiveItsSize) {
  BundleProblem problem = TwoCameras();
  problem.target.span_sigma_m = 0.05;
  problem.rigid_target.points_m = {{0, 0, 0}, {0, 0.5, 0}};
  problem.rigid_target.sigma_m = {0.001, 0.001};
  RigUncertainty uncertainty = OfSecondCamera(0.001);
  DescribeScale(problem, 0, &uncertainty);
  EXPECT_NEAR(uncertainty.scale_sigma_rel, std::sqrt(2) * 0.001 / 0.5, 1e-12);
}

}  // namespace
}  // namespace rigcal::server::scale_uncertainty_test
