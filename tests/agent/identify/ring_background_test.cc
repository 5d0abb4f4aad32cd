// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/ring_background.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "agent/identify/marker_aperture.h"

namespace rigcal::agent::ring_background_test {
namespace {

constexpr int kSide = 80;
constexpr double kRadiusPx = 12, kFromPx = 3, kWidthPx = 4;
constexpr uint8_t kMarker = 200, kLeft = 40, kRight = 90;

// A disc of kMarker that ends where the ring begins, before two halves.
struct Scene {
  Scene() {
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        const double away = (Eigen::Vector2d(x, y) - kCentre).norm();
        const bool is_inside = away < kRadiusPx + kFromPx;
        pixels.push_back(is_inside ? kMarker : x < kCentre.x() ? kLeft : kRight);
      }
    }
    Blob blob;
    blob.centre_px = kCentre;
    blob.second_moment_px2 = 0.25 * kRadiusPx * kRadiusPx * Eigen::Matrix2d::Identity();
    blob.area_px = static_cast<int>(std::numbers::pi * kRadiusPx * kRadiusPx);
    aperture.emplace_back(blob);
  }

  bool Read(RingBackground* background) const {
    const ImageView image{pixels.data(), kSide, kSide, kSide, PixelFormat::kMono8};
    double noise_grey = 0;
    return background->Read(image, aperture[0], {image.Bounds(), 1}, {kMarker, 0, 0},
                            {kFromPx, kWidthPx, 4}, &noise_grey);
  }

  inline static const Eigen::Vector2d kCentre{39.3, 40.6};
  std::vector<uint8_t> pixels;
  std::vector<MarkerAperture> aperture;
};

// Nothing of the disc, and all around: what is skipped is inside only.
TEST(RingBackground, IsReadAllAroundOutsideOfTheDisc) {
  const Scene scene;
  RingBackground background;
  ASSERT_TRUE(scene.Read(&background));
  const auto& arcs = background.arcs();
  const double ring_px2 = std::numbers::pi * (std::pow(kRadiusPx + kFromPx + kWidthPx, 2) -
                                              std::pow(kRadiusPx + kFromPx, 2));
  int pixels = 0;
  for (size_t k = 0; k < arcs.size(); ++k) {
    pixels += arcs[k].pixels;
    const double turn = (static_cast<double>(k) + 0.5) / static_cast<double>(arcs.size());
    const double x = std::cos(2 * std::numbers::pi * (turn - 0.5));
    if (std::abs(x) > 0.3) {
      EXPECT_EQ(arcs[k].background[0], x < 0 ? kLeft : kRight) << k;
    }
  }
  // Arcs overlap by 0.3 of their length on each side.
  EXPECT_NEAR(pixels, 1.6 * ring_px2, 0.1 * ring_px2);
}

TEST(RingBackground, DirectionsAreThoseOfThePixels) {
  const Scene scene;
  RingBackground background;
  ASSERT_TRUE(scene.Read(&background));
  const auto arcs = static_cast<double>(background.arcs().size());
  std::vector<float> turns;
  for (const double y : {-7.4, -0.5, 0.0, 0.3, 9.0}) {
    for (const int step : {1, 3}) {
      background.TurnsOf({-10, y}, step, 21, &turns);
      for (int i = 0; i < 21; ++i) {
        const double angle = std::atan2(y, -10 + i * step);
        const double own = 2 * std::numbers::pi *
                           (static_cast<double>(turns[static_cast<size_t>(i)]) / arcs - 0.5);
        EXPECT_NEAR(std::remainder(own - angle, 2 * std::numbers::pi), 0, 2e-4) << y << " " << i;
      }
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::ring_background_test
