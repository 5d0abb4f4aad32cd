// SPDX-License-Identifier: Apache-2.0
#include "common/camera/projection.h"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <random>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics_vector.h"

namespace rigcal::projection_test {
namespace {

using Jet = ceres::Jet<double, 3 + kMaxIntrinsics>;

IntrinsicsVector Lens(DistortionModel model) {
  IntrinsicsVector values(IntrinsicsSize(model));
  switch (model) {
    case DistortionModel::kBrownConrady:
      values << 1010, 990, 633, 517, -0.21, 0.11, 1e-3, -2e-3, 0.03;
      break;
    case DistortionModel::kRational:
      values << 1010, 990, 633, 517, 0.21, -0.11, 1e-3, -2e-3, 0.03, 0.3, -0.05, 0.02;
      break;
    case DistortionModel::kFisheye:
      values << 610, 590, 633, 517, -0.02, 0.01, -3e-3, 1e-3;
      break;
  }
  return values;
}

ProjectedPoint<double> ProjectAll(DistortionModel model, const IntrinsicsVector& intrinsics,
                                  const Eigen::Vector3d& point) {
  const double x_in_cam[3] = {point.x(), point.y(), point.z()};
  ProjectedPoint<double> projected;
  ProjectPoint<true, true>(model, intrinsics.data(), x_in_cam, &projected);
  return projected;
}

class Projection : public ::testing::TestWithParam<DistortionModel> {};

// Analytic derivatives against those of dual numbers through the same template.
TEST_P(Projection, DerivativesAgreeWithAutomaticDifferentiation) {
  const IntrinsicsVector intrinsics = Lens(GetParam());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> side(-1.2, 1.2), depth(0.5, 5);
  for (int i = 0; i < 200; ++i) {
    const double z = depth(random);
    const Eigen::Vector3d point(z * side(random), z * side(random), z);
    const ProjectedPoint<double> analytic = ProjectAll(GetParam(), intrinsics, point);
    Jet jet_point[3], jet_intrinsics[kMaxIntrinsics];
    for (int c = 0; c < 3; ++c) jet_point[c] = Jet(point[c], c);
    for (int c = 0; c < intrinsics.size(); ++c) {
      jet_intrinsics[c] = Jet(intrinsics[c], 3 + c);
    }
    ProjectedPoint<Jet> automatic;
    ProjectPoint<false, false>(GetParam(), jet_intrinsics, jet_point, &automatic);
    for (int r = 0; r < 2; ++r) {
      // Not equal: dual numbers divide by multiplying with the inverse.
      EXPECT_NEAR(analytic.pixel[r], automatic.pixel[r].a, 1e-9);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(analytic.d_point[r][c], automatic.pixel[r].v[c], 1e-8);
      }
      for (int c = 0; c < intrinsics.size(); ++c) {
        EXPECT_NEAR(analytic.d_intrinsics[r][c], automatic.pixel[r].v[3 + c], 1e-8);
      }
    }
  }
}

TEST_P(Projection, DerivativesAgreeWithDifferences) {
  const double step = 1e-6;
  const IntrinsicsVector intrinsics = Lens(GetParam());
  const Eigen::Vector3d point(0.7, -0.4, 1.9);
  const ProjectedPoint<double> at = ProjectAll(GetParam(), intrinsics, point);
  for (int c = 0; c < 3; ++c) {
    const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(c);
    const auto plus = ProjectAll(GetParam(), intrinsics, point + delta);
    const auto minus = ProjectAll(GetParam(), intrinsics, point - delta);
    for (int r = 0; r < 2; ++r) {
      EXPECT_NEAR(at.d_point[r][c], (plus.pixel[r] - minus.pixel[r]) / (2 * step), 1e-5);
    }
  }
  for (int c = 0; c < intrinsics.size(); ++c) {
    const IntrinsicsVector delta = step * IntrinsicsVector::Unit(intrinsics.size(), c);
    const auto plus = ProjectAll(GetParam(), intrinsics + delta, point);
    const auto minus = ProjectAll(GetParam(), intrinsics - delta, point);
    for (int r = 0; r < 2; ++r) {
      EXPECT_NEAR(at.d_intrinsics[r][c], (plus.pixel[r] - minus.pixel[r]) / (2 * step), 1e-5);
    }
  }
}

TEST_P(Projection, OnTheAxisEverythingIsFinite) {
  const IntrinsicsVector intrinsics = Lens(GetParam());
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;
  IntrinsicsJacobian d_intrinsics;
  ASSERT_TRUE(Project(GetParam(), intrinsics.data(), {0, 0, 2}, &pixel, &d_point, &d_intrinsics));
  EXPECT_LT((pixel - Eigen::Vector2d(633, 517)).norm(), 1e-9);
  EXPECT_NEAR(d_point(0, 0), intrinsics[0] / 2, 1e-6);
  EXPECT_TRUE(d_point.allFinite());
  EXPECT_TRUE(d_intrinsics.allFinite());
  EXPECT_EQ(d_intrinsics.cols(), IntrinsicsSize(GetParam()));
}

TEST_P(Projection, VectorsKeepEveryValue) {
  const IntrinsicsVector values = Lens(GetParam());
  EXPECT_EQ(ToVector(FromVector(GetParam(), values)), values);
}

INSTANTIATE_TEST_SUITE_P(EveryModel, Projection,
                         ::testing::Values(DistortionModel::kBrownConrady,
                                           DistortionModel::kRational, DistortionModel::kFisheye));

TEST(ProjectPoint, IsNotVisibleBeyondAPole) {
  IntrinsicsVector intrinsics = Lens(DistortionModel::kRational);
  intrinsics.tail<3>() << -1, 0, 0;  // the denominator is 1 - r^2
  EXPECT_GT(ProjectAll(DistortionModel::kRational, intrinsics, {0.9, 0, 1}).visible, 0);
  EXPECT_LE(ProjectAll(DistortionModel::kRational, intrinsics, {1.1, 0, 1}).visible, 0);
}

}  // namespace
}  // namespace rigcal::projection_test
