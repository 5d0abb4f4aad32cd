// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/projection_jacobian.h"

#include <gtest/gtest.h>

#include <random>

#include "common/camera/camera_model.h"

namespace rigcal::server::projection_jacobian_test {
namespace {

Intrinsics Camera(DistortionModel model) {
  Intrinsics intrinsics;
  intrinsics.model = model;
  intrinsics.fx_px = 1250;
  intrinsics.fy_px = 1240;
  intrinsics.cx_px = 640;
  intrinsics.cy_px = 500;
  const std::vector<double> all = {-0.22, 0.14, 0.0011, -0.0007, -0.05, 0.03, -0.02, 0.01};
  intrinsics.distortion.assign(all.begin(), all.begin() + CoefficientCount(model));
  if (model == DistortionModel::kFisheye) intrinsics.distortion = {-0.02, 0.01, -0.004, 0.001};
  return intrinsics;
}

class EveryModel : public ::testing::TestWithParam<DistortionModel> {};

TEST_P(EveryModel, ProjectsAsTheCameraModelDoes) {
  const Intrinsics intrinsics = Camera(GetParam());
  const IntrinsicsVector values = ToVector(intrinsics);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> side(-1.2, 1.2), depth(1.5, 6);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point(side(random), side(random), depth(random));
    Eigen::Vector2d expected, pixel;
    Eigen::Matrix<double, 2, 3> expected_jacobian, jacobian;
    ASSERT_TRUE(Project(intrinsics, point, &expected, &expected_jacobian));
    ASSERT_TRUE(ProjectWithJacobian(GetParam(), values.data(), point, &pixel, &jacobian, nullptr));
    EXPECT_LT((pixel - expected).norm(), 1e-9);
    EXPECT_LT((jacobian - expected_jacobian).norm(), 1e-8 * expected_jacobian.norm());
  }
}

TEST_P(EveryModel, JacobiansAgreeWithDifferences) {
  const IntrinsicsVector values = ToVector(Camera(GetParam()));
  const Eigen::Vector3d point(0.5, -0.4, 2.1);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;
  IntrinsicsJacobian d_intrinsics;
  ASSERT_TRUE(
      ProjectWithJacobian(GetParam(), values.data(), point, &pixel, &d_point, &d_intrinsics));
  ASSERT_EQ(d_intrinsics.cols(), IntrinsicsSize(GetParam()));
  const double step = 1e-6;
  const auto at = [](const IntrinsicsVector& v, const Eigen::Vector3d& p) {
    Eigen::Vector2d result;
    EXPECT_TRUE(ProjectWithJacobian(GetParam(), v.data(), p, &result, nullptr, nullptr));
    return result;
  };
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(i);
    const Eigen::Vector2d numeric =
        (at(values, point + offset) - at(values, point - offset)) / (2 * step);
    EXPECT_LT((d_point.col(i) - numeric).norm(), 1e-5) << i;
  }
  for (int i = 0; i < values.size(); ++i) {
    IntrinsicsVector plus = values, minus = values;
    plus[i] += step;
    minus[i] -= step;
    const Eigen::Vector2d numeric = (at(plus, point) - at(minus, point)) / (2 * step);
    EXPECT_LT((d_intrinsics.col(i) - numeric).norm(), 1e-4) << i;
  }
}

TEST_P(EveryModel, OnTheAxisIsFinite) {
  const IntrinsicsVector values = ToVector(Camera(GetParam()));
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> d_point;
  IntrinsicsJacobian d_intrinsics;
  ASSERT_TRUE(
      ProjectWithJacobian(GetParam(), values.data(), {0, 0, 2}, &pixel, &d_point, &d_intrinsics));
  EXPECT_LT((pixel - Eigen::Vector2d(640, 500)).norm(), 1e-9);
  EXPECT_TRUE(d_point.allFinite());
  EXPECT_TRUE(d_intrinsics.allFinite());
  EXPECT_NEAR(d_point(0, 0), 625, 1e-6);
}

TEST_P(EveryModel, RefusesWhatItCannotSee) {
  const IntrinsicsVector values = ToVector(Camera(GetParam()));
  Eigen::Vector2d pixel;
  for (const double z : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(
        ProjectWithJacobian(GetParam(), values.data(), {0.1, 0.1, z}, &pixel, nullptr, nullptr));
  }
}

TEST_P(EveryModel, VectorsKeepEveryValue) {
  const Intrinsics intrinsics = Camera(GetParam());
  EXPECT_EQ(FromVector(GetParam(), ToVector(intrinsics)), intrinsics);
}

INSTANTIATE_TEST_SUITE_P(ProjectionJacobian, EveryModel,
                         ::testing::Values(DistortionModel::kBrownConrady,
                                           DistortionModel::kRational, DistortionModel::kFisheye));

}  // namespace
}  // namespace rigcal::server::projection_jacobian_test
