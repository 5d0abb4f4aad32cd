// SPDX-License-Identifier: Apache-2.0
#include "common/camera/sphere_projection.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "common/camera/camera_model.h"

namespace rigcal::sphere_projection_test {
namespace {

Intrinsics Lens(bool distorted) {
  Intrinsics intrinsics;
  intrinsics.fx_px = 1000;
  intrinsics.fy_px = 1010;
  intrinsics.cx_px = 640;
  intrinsics.cy_px = 512;
  if (distorted) intrinsics.distortion = {-0.2, 0.1, 0.001, -0.0005, -0.02};
  return intrinsics;
}

TEST(ProjectSphere, AgreesWithTheClosedFormOfTheEllipse) {
  const Intrinsics intrinsics = Lens(false);
  const double radius_m = 0.02;
  for (const Eigen::Vector3d& x :
       {Eigen::Vector3d(0.9, 0, 1.5), {-0.3, 0.4, 0.8}, {0, 0, 2}, {0.1, -1, 1.1}}) {
    SphereProjection image;
    ASSERT_TRUE(ProjectSphere(intrinsics, x, 2 * radius_m, &image));
    const double divisor = x.z() * x.z() - radius_m * radius_m;
    EXPECT_NEAR(image.centroid_px.x(), 640 + 1000 * x.x() * x.z() / divisor, 1e-9);
    EXPECT_NEAR(image.centroid_px.y(), 512 + 1010 * x.y() * x.z() / divisor, 1e-9);
    // The cone's section, scaled by both focal lengths.
    const double semi_product = radius_m * radius_m / std::pow(divisor, 1.5) *
                                std::sqrt(x.squaredNorm() - radius_m * radius_m);
    EXPECT_NEAR(image.area_px2, M_PI * semi_product * 1000 * 1010, 1e-6 * image.area_px2);
  }
}

TEST(ProjectSphere, IsAnEighthOfAPixelOffForTheDesignsExample) {
  const Intrinsics intrinsics = Lens(false);
  const Eigen::Vector3d x = Eigen::Vector3d(0.6, 0, 1).normalized() * 1.5;
  SphereProjection image;
  ASSERT_TRUE(ProjectSphere(intrinsics, x, 0.04, &image));
  EXPECT_NEAR((image.centroid_px - image.centre_px).x(), 0.14, 0.02);
}

// The mean over the solid angle of the cone's pixels, with any lens.
TEST(ProjectSphere, IsTheMeanOfTheSpheresPixelsUnderDistortion) {
  const Intrinsics intrinsics = Lens(true);
  const Eigen::Vector3d x(0.55, -0.4, 1.2);
  const double radius_m = 0.04, cosine = std::sqrt(1 - std::pow(radius_m / x.norm(), 2));
  SphereProjection image;
  ASSERT_TRUE(ProjectSphere(intrinsics, x, 2 * radius_m, &image));
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  int count = 0;
  const double step_px = 0.25;
  for (double v = -50; v < 50; v += step_px) {
    for (double u = -50; u < 50; u += step_px) {
      const Eigen::Vector2d pixel = image.centre_px + Eigen::Vector2d(u, v);
      const auto ray = Undistort(intrinsics, pixel);
      ASSERT_TRUE(ray.ok());
      if (ray->homogeneous().normalized().dot(x.normalized()) < cosine) continue;
      sum += pixel;
      ++count;
    }
  }
  EXPECT_LT((sum / count - image.centroid_px).norm(), 0.01);
  EXPECT_NEAR(count * step_px * step_px, image.area_px2, 0.005 * image.area_px2);
}

TEST(SphereCentreFromCentroid, TakesTheOffsetBack) {
  for (const bool distorted : {false, true}) {
    const Intrinsics intrinsics = Lens(distorted);
    const Eigen::Vector3d x(-0.5, 0.45, 1.1);
    SphereProjection image;
    ASSERT_TRUE(ProjectSphere(intrinsics, x, 0.1, &image));
    Eigen::Vector2d centre;
    ASSERT_TRUE(SphereCentreFromCentroid(intrinsics, image.centroid_px, x.norm(), 0.1, &centre));
    EXPECT_LT((centre - image.centre_px).norm(), 1e-5);
    EXPECT_GT((image.centroid_px - image.centre_px).norm(), 0.5);
  }
}

TEST(ProjectSphere, RefusesWhatTheCameraDoesNotSee) {
  const Intrinsics intrinsics = Lens(false);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  SphereProjection image;
  EXPECT_FALSE(ProjectSphere(intrinsics, {0, 0, -1}, 0.04, &image));
  EXPECT_FALSE(ProjectSphere(intrinsics, {0, 0, 0.01}, 0.04, &image)) << "inside the sphere";
  EXPECT_FALSE(ProjectSphere(intrinsics, {1, 0, 0.01}, 0.04, &image)) << "part of it is behind";
  EXPECT_FALSE(ProjectSphere(intrinsics, {nan, 0, 1}, 0.04, &image));
  EXPECT_FALSE(ProjectSphere(intrinsics, {0, 0, 1}, nan, &image));
  Eigen::Vector2d centre;
  EXPECT_FALSE(SphereCentreFromCentroid(intrinsics, {nan, 0}, 1, 0.04, &centre));
}

}  // namespace
}  // namespace rigcal::sphere_projection_test
