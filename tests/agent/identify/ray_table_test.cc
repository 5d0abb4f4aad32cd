// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ray_table.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

#include "common/camera/camera_model.h"
#include "common/camera/intrinsics.h"

namespace rigcal::agent {
namespace {

constexpr ImageSize kSize{1280, 1024}, kLargeSize{12800, 10240};

struct Lens {
  std::string name;
  DistortionModel model;
  std::vector<double> distortion;
};

class RayTableTest : public ::testing::TestWithParam<Lens> {
 protected:
  Intrinsics Make() const {
    Intrinsics intrinsics;
    intrinsics.fx_px = 720;
    intrinsics.fy_px = 715;
    intrinsics.cx_px = 650;
    intrinsics.cy_px = 500;
    intrinsics.model = GetParam().model;
    intrinsics.distortion = GetParam().distortion;
    return intrinsics;
  }
};

// Everywhere, beyond the image too, where some of these lenses have no ray.
TEST_P(RayTableTest, IsWhatTheLensSays) {
  const Intrinsics intrinsics = Make();
  const RayTable table(intrinsics, kSize);
  int seen = 0;
  for (double y = -200; y < kSize.height + 200; y += 13.7) {
    for (double x = -200; x < kSize.width + 200; x += 17.3) {
      const Eigen::Vector2d pixel(x, y);
      const auto exact = Undistort(intrinsics, pixel);
      Eigen::Vector2d ray;
      Eigen::Matrix<double, 2, 3> derivative;
      ASSERT_EQ(table.RayOf(pixel, &ray, &derivative), exact.ok()) << pixel.transpose();
      ASSERT_EQ(table.HasRay(pixel), exact.ok()) << pixel.transpose();
      if (!exact.ok()) continue;
      ++seen;
      Eigen::Vector2d again_px;
      Eigen::Matrix<double, 2, 3> exact_derivative;
      ASSERT_TRUE(Project(intrinsics, ray.homogeneous(), &again_px, &exact_derivative));
      EXPECT_LT((again_px - pixel).norm(), 1e-4) << pixel.transpose();
      EXPECT_LT((derivative - exact_derivative).norm(), 1e-3 * exact_derivative.norm())
          << pixel.transpose();
    }
  }
  EXPECT_GT(seen, 2000);
}

TEST_P(RayTableTest, HasNoneForNoPixel) {
  const RayTable table(Make(), kSize);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  Eigen::Vector2d ray;
  Eigen::Matrix<double, 2, 3> derivative;
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(nan, 5), Eigen::Vector2d(5, nan), Eigen::Vector2d(infinity, 5),
        Eigen::Vector2d(5, -infinity)}) {
    EXPECT_FALSE(table.RayOf(pixel, &ray, &derivative)) << pixel.transpose();
    EXPECT_FALSE(table.HasRay(pixel)) << pixel.transpose();
  }
}

// A table of a large image is no larger.
TEST_P(RayTableTest, IsWhatTheLensSaysOfALargeImage) {
  Intrinsics intrinsics = Make();
  for (double* value :
       {&intrinsics.fx_px, &intrinsics.fy_px, &intrinsics.cx_px, &intrinsics.cy_px}) {
    *value *= 10;
  }
  const RayTable table(intrinsics, kLargeSize);
  for (double y = 0; y < kLargeSize.height; y += 237) {
    for (double x = 0; x < kLargeSize.width; x += 173) {
      const Eigen::Vector2d pixel(x, y);
      const auto exact = Undistort(intrinsics, pixel);
      Eigen::Vector2d ray, again_px;
      Eigen::Matrix<double, 2, 3> derivative;
      ASSERT_EQ(table.RayOf(pixel, &ray, &derivative), exact.ok()) << pixel.transpose();
      if (!exact.ok()) continue;
      ASSERT_TRUE(Project(intrinsics, ray.homogeneous(), &again_px, nullptr));
      EXPECT_LT((again_px - pixel).norm(), 1e-3) << pixel.transpose();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Lenses, RayTableTest,
    ::testing::Values(
        Lens{"none", DistortionModel::kBrownConrady, {}},
        Lens{"brown", DistortionModel::kBrownConrady, {-0.28, 0.09, 1e-3, -8e-4, -0.012}},
        // No ray in the corners.
        Lens{"strong", DistortionModel::kBrownConrady, {-0.42, 0.02, 0, 0, 0}},
        Lens{"fisheye", DistortionModel::kFisheye, {-0.02, 0.004, -0.001, 0.0002}}),
    [](const auto& lens) { return lens.param.name; });

}  // namespace
}  // namespace rigcal::agent
