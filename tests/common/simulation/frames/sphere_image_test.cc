// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/sphere_image.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "common/camera/camera_model.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::sphere_image_test {
namespace {

constexpr double kRadiusM = 0.02;
const ImageSize kSize{1280, 1024};

Intrinsics BrownConrady() {
  return {DistortionModel::kBrownConrady, 1250, 1248, 633, 517, {-0.22, 0.2, 5e-4, -7e-4, -0.16}};
}
Intrinsics Rational() {
  return {DistortionModel::kRational, 900, 900, 640, 512, {-0.1, 0.05, 1e-4, 0, 0, 0.1, 0, 0}};
}
Intrinsics Fisheye() {
  return {DistortionModel::kFisheye, 560, 560, 640, 512, {-0.02, 0.004, 0, 0}};
}

// A point that projects to about `pixel`.
Eigen::Vector3d At(const Intrinsics& intrinsics, double x_px, double y_px, double distance_m) {
  return distance_m * Undistort(intrinsics, {x_px, y_px})->homogeneous().normalized();
}

// Mass, mean and spread of weights over pixels.
struct Spot {
  double mass = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();

  void Add(const Eigen::Vector2d& pixel, double weight) {
    mass += weight;
    mean += weight * pixel;
    spread += weight * pixel * pixel.transpose();
  }
  void Finish() {
    mean /= mass;
    spread = (spread / mass - mean * mean.transpose()).eval();
  }
};

Spot SpotOf(const SphereImage& image, const std::vector<float>& values) {
  Spot spot;
  size_t i = 0;
  for (int y = 0; y < image.patch.height; ++y) {
    for (int x = 0; x < image.patch.width; ++x, ++i) {
      spot.Add({image.patch.x + x, image.patch.y + y}, static_cast<double>(values[i]));
    }
  }
  spot.Finish();
  return spot;
}

// The sphere's image by brute force: every point of a fine lattice is undistorted exactly and its
// ray tested against the sphere.
Spot Reference(const Intrinsics& intrinsics, const Eigen::Vector3d& centre, double reach_px) {
  Eigen::Vector2d middle;
  EXPECT_TRUE(Project(intrinsics, centre, &middle));
  // A small image needs a finer one.
  const int per_px = reach_px < 12 ? 24 : 9;
  const int steps = static_cast<int>(per_px * reach_px);
  Spot spot;
  for (int i = -steps; i <= steps; ++i) {
    for (int j = -steps; j <= steps; ++j) {
      const Eigen::Vector2d pixel = middle + Eigen::Vector2d(i, j) / per_px;
      const auto ray = Undistort(intrinsics, pixel);
      if (!ray.ok()) continue;
      const Eigen::Vector3d direction = ray->homogeneous().normalized();
      if (direction.cross(centre).norm() < kRadiusM) spot.Add(pixel, 1.0 / (per_px * per_px));
    }
  }
  spot.Finish();
  return spot;
}

class SphereImagerTest : public ::testing::Test {
 protected:
  SphereImage Draw(const Intrinsics& intrinsics, const SphereMotion& sphere,
                   const std::vector<ExposurePart>& parts, double blur_px, double limb = 0) {
    SphereImager imager = *SphereImager::Create(intrinsics, kSize);
    SphereImage image;
    drawn_ = imager.Draw(sphere, parts, EdgeProfile(blur_px, 0), {kRadiusM, limb, 0}, &image);
    return image;
  }
  SphereImage DrawStill(const Intrinsics& intrinsics, const Eigen::Vector3d& centre,
                        double blur_px) {
    return Draw(intrinsics, {centre, {0, 0, 0}, {0, 0, 0}}, {{0, 1, 1}}, blur_px);
  }
  bool drawn_ = false;
};

TEST_F(SphereImagerTest, IsTheExactImageWithEveryLens) {
  struct Place {
    double x_px, y_px, distance_m;
  };
  for (const Intrinsics& intrinsics : {BrownConrady(), Rational(), Fisheye()}) {
    for (const Place& place : {Place{640.3, 511.8, 1.5}, Place{1220.2, 60.7, 1.5},
                               Place{100.5, 900.1, 2.7}, Place{350.9, 300.2, 6}}) {
      const Eigen::Vector3d centre = At(intrinsics, place.x_px, place.y_px, place.distance_m);
      const Spot expected =
          Reference(intrinsics, centre, 1.5 * intrinsics.fx_px * kRadiusM / place.distance_m + 3);
      const double radius_squared = expected.mass / std::numbers::pi;
      for (const double blur_px : {0.0, 0.6, 1.5}) {
        const SphereImage image = DrawStill(intrinsics, centre, blur_px);
        const Spot spot = SpotOf(image, image.cover);
        const auto where = ::testing::Message()
                           << DistortionModelName(intrinsics.model) << " at " << place.x_px << ", "
                           << place.y_px << ", " << place.distance_m << " m, blur " << blur_px;
        // The judged errors of a detector are 0.02 to 0.06 px. The lattice itself is right to about
        // 0.002 px in the mean; without any blur the pixels themselves are coarse.
        EXPECT_LT((spot.mean - expected.mean).norm(),
                  blur_px > 0 ? 0.004 : 0.006 + 0.12 / radius_squared)
            << where;
        if (blur_px > 1) continue;  // the straight edge stands for one that is curved
        EXPECT_NEAR(spot.mass / expected.mass, 1, 0.006 + (blur_px > 0 ? 0 : 0.06 / radius_squared))
            << where;
        EXPECT_LT((spot.spread - expected.spread -
                   (blur_px * blur_px + 1.0 / 12) * Eigen::Matrix2d::Identity())
                      .norm(),
                  0.02 * expected.spread.trace() + 0.02)
            << where;
      }
    }
  }
}

TEST_F(SphereImagerTest, ItsCentreIsNotTheProjectedCentre) {
  const Intrinsics lens = BrownConrady();
  const Eigen::Vector3d centre = At(lens, 1200, 800, 1.5);
  Eigen::Vector2d projected;
  ASSERT_TRUE(Project(lens, centre, &projected));
  const SphereImage image = DrawStill(lens, centre, 0.6);
  const double apart_px = (SpotOf(image, image.cover).mean - projected).norm();
  EXPECT_GT(apart_px, 0.04);
  EXPECT_LT(apart_px, 0.25);
}

TEST_F(SphereImagerTest, MotionMovesTheLightToItsMeanTime) {
  const Intrinsics lens = BrownConrady();
  const SphereMotion sphere{At(lens, 400, 300, 2), {1.4, 1.2, -0.8}, {3, -4, 2}};
  const auto parts = PlanExposure(0.005, {500, 0.5, 0.0003}, 1e-4);
  const SphereImage image = Draw(lens, sphere, parts, 0.6);
  Spot cover, lit;
  double lit_share = 0;
  for (const ExposurePart& part : parts) {
    const Eigen::Vector3d centre = sphere.centre_m + part.dt_s * sphere.velocity_m_s +
                                   0.5 * part.dt_s * part.dt_s * sphere.acceleration_m_s2;
    const Spot spot = Reference(lens, centre, 18);
    cover.Add(spot.mean, part.share * spot.mass);
    lit.Add(spot.mean, part.lit_share * spot.mass);
    lit_share += part.lit_share;
  }
  cover.Finish();
  lit.Finish();
  const Spot drawn_cover = SpotOf(image, image.cover), drawn_lit = SpotOf(image, image.lit);
  EXPECT_LT((drawn_cover.mean - cover.mean).norm(), 0.004);
  EXPECT_LT((drawn_lit.mean - lit.mean).norm(), 0.004);
  EXPECT_NEAR(drawn_lit.mass / drawn_cover.mass, lit_share, 2e-3);
  // Blinks put some of the light elsewhere than the sphere was on the mean.
  EXPECT_GT((lit.mean - cover.mean).norm(), 0.01);
}

TEST_F(SphereImagerTest, LimbDarkensTheRimAndMovesNothing) {
  const Intrinsics lens = BrownConrady();
  const SphereMotion sphere{At(lens, 700, 300, 1.5), {0, 0, 0}, {0, 0, 0}};
  const SphereImage flat = Draw(lens, sphere, {{0, 1, 1}}, 0.6, 0);
  const SphereImage round = Draw(lens, sphere, {{0, 1, 1}}, 0.6, 0.6);
  const Spot flat_spot = SpotOf(flat, flat.lit), round_spot = SpotOf(round, round.lit);
  // The mean of the height over the disc is 2/3: 0.6 takes a fifth of the light.
  EXPECT_NEAR(round_spot.mass / flat_spot.mass, 0.8, 0.02);
  EXPECT_LT((flat_spot.mean - round_spot.mean).norm(), 0.02);
  EXPECT_EQ(flat.cover, round.cover);
}

TEST_F(SphereImagerTest, WhatIsNotInTheFrameIsNotDrawn) {
  const Intrinsics lens = BrownConrady();
  for (const Eigen::Vector3d& centre :
       {Eigen::Vector3d(0, 0, -2), Eigen::Vector3d(3, 0, 2), Eigen::Vector3d(0, 0, 0),
        Eigen::Vector3d(0, 0, 0.021), Eigen::Vector3d(0, -9, 0.1)}) {
    const SphereImage image = DrawStill(lens, centre, 0.6);
    // Where the lens model folds back there may be a patch, but nothing on it.
    EXPECT_EQ(image.patch.empty(), !drawn_);
    for (const float cover : image.cover) ASSERT_EQ(cover, 0) << centre.transpose();
  }
}

TEST_F(SphereImagerTest, StaysWithinTheFrameAtItsBorders) {
  for (const Intrinsics& lens : {BrownConrady(), Fisheye()}) {
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(0, 0), Eigen::Vector2d(1279, 1023), Eigen::Vector2d(-6, 500),
          Eigen::Vector2d(640, 1028), Eigen::Vector2d(1279.4, 2)}) {
      const SphereImage image = DrawStill(lens, At(lens, pixel.x(), pixel.y(), 1.5), 0.6);
      EXPECT_GE(image.patch.x, 0);
      EXPECT_GE(image.patch.y, 0);
      EXPECT_LE(image.patch.x + image.patch.width, 1280);
      EXPECT_LE(image.patch.y + image.patch.height, 1024);
      for (const float cover : image.cover) EXPECT_TRUE(cover >= 0 && cover <= 1.0001f);
    }
  }
}

// What blur spreads beyond the rim is light from the sphere, none of which is brighter than the
// place that faces the lamp.
TEST(SphereImager, BlurredLightIsNowhereBrighterThanTheSphere) {
  const Intrinsics intrinsics = BrownConrady();
  auto imager = SphereImager::Create(intrinsics, kSize);
  ASSERT_TRUE(imager.ok());
  SphereMotion sphere;
  sphere.centre_m = At(intrinsics, 640, 500, 5);
  SphereImageOptions options{.radius_m = kRadiusM};
  options.spot_direction = {0, -1, 0};
  SphereImage image;
  const ExposurePart all{0, 1, 1};
  ASSERT_TRUE(imager->Draw(sphere, {&all, 1}, EdgeProfile(1.5, 0), options, &image));
  for (size_t i = 0; i < image.spot.size(); ++i) {
    if (image.cover[i] <= 1e-3f) continue;
    EXPECT_LE(image.spot[i], image.cover[i] * 1.001f);
  }
}

}  // namespace
}  // namespace rigcal::sphere_image_test
