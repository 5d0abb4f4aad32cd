// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_model.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <random>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::camera_model_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double Draw(std::mt19937_64* random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*random);
}

// A lens such as real ones: coefficients for which the model is one to one over a 1280 x 1024
// image.
Intrinsics RandomIntrinsics(DistortionModel model, std::mt19937_64* random) {
  Intrinsics intrinsics;
  intrinsics.model = model;
  intrinsics.fx_px = Draw(random, 1000, 1400);
  intrinsics.fy_px = intrinsics.fx_px * Draw(random, 0.99, 1.01);
  intrinsics.cx_px = Draw(random, 600, 680);
  intrinsics.cy_px = Draw(random, 480, 540);
  const auto draw = [random](double low, double high) { return Draw(random, low, high); };
  switch (model) {
    case DistortionModel::kBrownConrady:
      intrinsics.distortion = {draw(-0.25, 0.15), draw(0, 0.2), draw(-2e-3, 2e-3),
                               draw(-2e-3, 2e-3), draw(-0.1, 0.05)};
      break;
    case DistortionModel::kRational:
      intrinsics.distortion = {draw(0.1, 0.4), draw(0, 0.1),   draw(-2e-3, 2e-3), draw(-2e-3, 2e-3),
                               draw(0, 0.02),  draw(0.3, 0.6), draw(0, 0.1),      draw(0, 0.02)};
      break;
    case DistortionModel::kFisheye:
      intrinsics.distortion = {draw(-0.05, 0.05), draw(-0.02, 0.02), draw(-0.01, 0.01),
                               draw(-0.005, 0.005)};
      break;
  }
  return intrinsics;
}

// A point in front of the camera whose direction lies in the field of view.
Eigen::Vector3d RandomPoint(std::mt19937_64* random) {
  const double z = Draw(random, 0.5, 12);
  return {z * Draw(random, -0.6, 0.6), z * Draw(random, -0.5, 0.5), z};
}

cv::Mat CameraMatrix(const Intrinsics& k) {
  return (cv::Mat_<double>(3, 3) << k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1);
}

Eigen::Vector2d OpenCvProject(const Intrinsics& intrinsics, const Eigen::Vector3d& point) {
  const std::vector<cv::Point3d> points = {{point.x(), point.y(), point.z()}};
  std::vector<cv::Point2d> pixels;
  const cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
  if (intrinsics.model == DistortionModel::kFisheye) {
    cv::fisheye::projectPoints(points, pixels, zero, zero, CameraMatrix(intrinsics),
                               intrinsics.distortion);
  } else {
    cv::projectPoints(points, zero, zero, CameraMatrix(intrinsics), intrinsics.distortion, pixels);
  }
  return {pixels[0].x, pixels[0].y};
}

class CameraModel : public ::testing::TestWithParam<DistortionModel> {
 protected:
  std::mt19937_64 random_{20240607};
};

TEST_P(CameraModel, ProjectsAsOpenCvDoes) {
  for (int lens = 0; lens < 50; ++lens) {
    const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector3d point = RandomPoint(&random_);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(intrinsics, point, &pixel));
      EXPECT_LT((pixel - OpenCvProject(intrinsics, point)).norm(), 1e-9) << point.transpose();
    }
  }
}

TEST_P(CameraModel, UndistortsToThePointThatWasProjected) {
  for (int lens = 0; lens < 50; ++lens) {
    const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
    for (int i = 0; i < 40; ++i) {
      const Eigen::Vector3d point = RandomPoint(&random_);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(intrinsics, point, &pixel));
      ASSERT_OK_AND_ASSIGN(const Eigen::Vector2d direction, Undistort(intrinsics, pixel));
      EXPECT_LT((direction - point.hnormalized()).norm(), 1e-9);
    }
  }
}

TEST_P(CameraModel, UndistortsAsOpenCvDoes) {
  for (int lens = 0; lens < 20; ++lens) {
    const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d pixel(Draw(&random_, 0, 1279), Draw(&random_, 0, 1023));
      const std::vector<cv::Point2d> pixels = {{pixel.x(), pixel.y()}};
      std::vector<cv::Point2d> expected;
      const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 200, 1e-14);
      if (GetParam() == DistortionModel::kFisheye) {
        cv::fisheye::undistortPoints(pixels, expected, CameraMatrix(intrinsics),
                                     intrinsics.distortion);
      } else {
        cv::undistortPoints(pixels, expected, CameraMatrix(intrinsics), intrinsics.distortion,
                            cv::noArray(), cv::noArray(), until);
      }
      ASSERT_OK_AND_ASSIGN(const Eigen::Vector2d direction, Undistort(intrinsics, pixel));
      // OpenCV stops iterating a little earlier than this does.
      EXPECT_LT((direction - Eigen::Vector2d(expected[0].x, expected[0].y)).norm(), 1e-6);
    }
  }
}

TEST_P(CameraModel, DerivativeIsThatOfNumericDifferences) {
  for (int lens = 0; lens < 50; ++lens) {
    const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d point = RandomPoint(&random_);
      Eigen::Vector2d pixel;
      Eigen::Vector2d plain;
      Eigen::Matrix<double, 2, 3> analytic;
      ASSERT_TRUE(Project(intrinsics, point, &pixel, &analytic));
      ASSERT_TRUE(Project(intrinsics, point, &plain));
      EXPECT_EQ(pixel, plain);
      Eigen::Matrix<double, 2, 3> numeric;
      const double step = 1e-6 * point.z();
      for (int axis = 0; axis < 3; ++axis) {
        Eigen::Vector2d after, before;
        ASSERT_TRUE(Project(intrinsics, point + step * Eigen::Vector3d::Unit(axis), &after));
        ASSERT_TRUE(Project(intrinsics, point - step * Eigen::Vector3d::Unit(axis), &before));
        numeric.col(axis) = (after - before) / (2 * step);
      }
      EXPECT_LT((analytic - numeric).norm(), 1e-6 * analytic.norm());
    }
  }
}

TEST_P(CameraModel, OnTheOpticalAxisIsThePrincipalPoint) {
  const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
  for (const double off_axis : {0.0, 1e-300, 1e-12, 1e-9}) {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> jacobian;
    ASSERT_TRUE(Project(intrinsics, Eigen::Vector3d(off_axis, 0, 2), &pixel, &jacobian));
    EXPECT_NEAR(pixel.x(), intrinsics.cx_px, 1e-5);
    EXPECT_NEAR(pixel.y(), intrinsics.cy_px, 1e-5);
    EXPECT_NEAR(jacobian(0, 0), intrinsics.fx_px / 2, 1e-6);
    EXPECT_NEAR(jacobian(1, 1), intrinsics.fy_px / 2, 1e-6);
    EXPECT_NEAR(jacobian(0, 2), 0, 1e-5);
  }
  ASSERT_OK_AND_ASSIGN(const Eigen::Vector2d direction,
                       Undistort(intrinsics, {intrinsics.cx_px, intrinsics.cy_px}));
  EXPECT_LT(direction.norm(), 1e-12);
}

TEST_P(CameraModel, NoCoefficientsMeansAllZero) {
  Intrinsics without = RandomIntrinsics(GetParam(), &random_);
  without.distortion.clear();
  Intrinsics with = without;
  with.distortion.assign(static_cast<size_t>(CoefficientCount(GetParam())), 0.0);
  const Eigen::Vector3d point(0.4, -0.3, 1.5);
  Eigen::Vector2d a, b;
  ASSERT_TRUE(Project(without, point, &a));
  ASSERT_TRUE(Project(with, point, &b));
  EXPECT_EQ(a, b);
}

TEST_P(CameraModel, SeesNothingBehindOrAtTheCamera) {
  const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
  for (const double z : {0.0, -0.0, -1e-300, -3.0}) {
    Eigen::Vector2d pixel(-7, -8);
    EXPECT_FALSE(Project(intrinsics, {0.1, 0.2, z}, &pixel)) << z;
    EXPECT_EQ(pixel, Eigen::Vector2d(-7, -8));
  }
}

TEST_P(CameraModel, RefusesPointsThatAreNotFinite) {
  const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 2; ++axis) {
      Eigen::Vector3d point(0.1, 0.2, 1);
      point[axis] = bad;
      Eigen::Vector2d pixel(-7, -8);
      Eigen::Matrix<double, 2, 3> jacobian;
      EXPECT_FALSE(Project(intrinsics, point, &pixel, &jacobian)) << point.transpose();
      EXPECT_EQ(pixel, Eigen::Vector2d(-7, -8));
    }
  }
  Eigen::Vector2d pixel;
  EXPECT_FALSE(Project(intrinsics, {0.1, 0.2, kNan}, &pixel));
}

TEST_P(CameraModel, RefusesPixelsThatAreNotFinite) {
  const Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    EXPECT_THAT(Undistort(intrinsics, {bad, 5}),
                StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("pixel")));
    EXPECT_THAT(Undistort(intrinsics, {5, bad}),
                StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("pixel")));
  }
}

TEST_P(CameraModel, RefusesAWrongNumberOfCoefficients) {
  Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
  intrinsics.distortion.pop_back();
  Eigen::Vector2d pixel;
  EXPECT_FALSE(Project(intrinsics, {0.1, 0.2, 1}, &pixel));
  EXPECT_THAT(Undistort(intrinsics, {600, 500}),
              StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("pixel")));
}

// Whatever the coefficients, an answer is a true inverse: it lies on the near side of every fold,
// and distorting it gives the pixel back.
TEST_P(CameraModel, UndistortEitherInvertsOrRefuses) {
  int answers = 0;
  int refusals = 0;
  for (int i = 0; i < 20000; ++i) {
    Intrinsics intrinsics = RandomIntrinsics(GetParam(), &random_);
    for (double& coefficient : intrinsics.distortion) {
      coefficient = std::pow(10, Draw(&random_, -4, 2)) * (Draw(&random_, -1, 1) < 0 ? -1 : 1);
    }
    const Eigen::Vector2d pixel(Draw(&random_, -2000, 4000), Draw(&random_, -2000, 4000));
    const absl::StatusOr<Eigen::Vector2d> direction = Undistort(intrinsics, pixel);
    if (!direction.ok()) {
      EXPECT_EQ(direction.status().code(), absl::StatusCode::kOutOfRange);
      ++refusals;
      continue;
    }
    ++answers;
    Eigen::Vector2d again;
    ASSERT_TRUE(direction->allFinite());
    ASSERT_TRUE(Project(intrinsics, Eigen::Vector3d(direction->x(), direction->y(), 1), &again));
    const Eigen::Vector2d error((again.x() - pixel.x()) / intrinsics.fx_px,
                                (again.y() - pixel.y()) / intrinsics.fy_px);
    EXPECT_LT(error.norm(), 2e-9);
  }
  EXPECT_GT(answers, 1000);
  EXPECT_GT(refusals, 1000);
}

INSTANTIATE_TEST_SUITE_P(AllModels, CameraModel,
                         ::testing::Values(DistortionModel::kBrownConrady,
                                           DistortionModel::kRational, DistortionModel::kFisheye),
                         [](const auto& model) {
                           return std::string(DistortionModelName(model.param));
                         });

// r (1 - r^2) rises to 0.385 at r = 0.577 and falls after that.
TEST(Undistort, RefusesPixelsBeyondTheFold) {
  const Intrinsics barrel{DistortionModel::kBrownConrady, 1000, 1000, 500, 500, {-1, 0, 0, 0, 0}};
  ASSERT_OK_AND_ASSIGN(const Eigen::Vector2d inside, Undistort(barrel, {500 + 384, 500}));
  EXPECT_NEAR(inside.x() * (1 - inside.x() * inside.x()), 0.384, 1e-9);
  EXPECT_LT(inside.x(), 0.578);
  EXPECT_THAT(Undistort(barrel, {500 + 386, 500}),
              StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("886")));
}

// r (1 - 4 r^2 + 10 r^4) rises, falls and rises again: beyond the dip the value 0.9 is met once
// more, on the far side of the fold.
TEST(Undistort, RefusesSolutionsOnTheFarSideOfAFold) {
  const Intrinsics folded{DistortionModel::kBrownConrady, 1000, 1000, 500, 500, {-4, 5, 0, 0, 0}};
  EXPECT_THAT(Undistort(folded, {500 + 900, 500}),
              StatusIs(absl::StatusCode::kOutOfRange, HasSubstr("inverse")));
  ASSERT_OK_AND_ASSIGN(const Eigen::Vector2d near, Undistort(folded, {500 + 150, 500}));
  EXPECT_LT(near.x(), 0.2);
}

TEST(Project, RefusesPointsBeyondAPoleOfTheRationalModel) {
  const Intrinsics lens{DistortionModel::kRational, 1000, 1000, 500, 500,
                        {0, 0, 0, 0, 0, -1, 0, 0}};
  Eigen::Vector2d pixel;
  EXPECT_TRUE(Project(lens, {0.9, 0, 1}, &pixel));
  EXPECT_FALSE(Project(lens, {1.0, 0, 1}, &pixel));
  EXPECT_FALSE(Project(lens, {1.1, 0, 1}, &pixel));
}

}  // namespace
}  // namespace rigcal::camera_model_test
