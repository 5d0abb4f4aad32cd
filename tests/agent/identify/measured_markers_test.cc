// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/measured_markers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace rigcal::agent::measured_markers_test {
namespace {

TEST(IsOnOutline, LessOfTheEdgeIsEnoughWhereNoneIsElsewhere) {
  SphereOutline outline;
  outline.radius_px = 8;
  outline.on_outline = 9.0 / 16;
  EXPECT_TRUE(IsOnOutline(outline));
  outline.off_outline = 1.0 / 16;
  EXPECT_FALSE(IsOnOutline(outline));
  outline.on_outline = 10.0 / 16;
  EXPECT_TRUE(IsOnOutline(outline));
}

constexpr int kSize = 64;
constexpr double kRadius = 8;
const Eigen::Vector2d kTruePx(31.3, 32.8);

// Of a disc with a soft edge: `grey(share, x, y, channel)`, the share of a pixel that it covers.
template <typename Grey>
std::vector<uint8_t> Render(Grey grey) {
  std::vector<uint8_t> pixels(kSize * kSize * 3);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double outside_px = (Eigen::Vector2d(x, y) - kTruePx).norm() - kRadius;
      const double share = 0.5 * std::erfc(outside_px / (0.7 * std::sqrt(2.0)));
      for (int k = 0; k < 3; ++k) {
        pixels[static_cast<size_t>((y * kSize + x) * 3 + k)] =
            static_cast<uint8_t>(std::lround(grey(share, x, y, k)));
      }
    }
  }
  return pixels;
}

Blob SphereBlob() {
  Blob blob;
  blob.centre_px = kTruePx + Eigen::Vector2d(0.2, -0.2);
  blob.second_moment_px2 = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
  blob.area_px = 201;
  return blob;
}

// The sphere of an image, measured.
struct MeasuredSphere {
  explicit MeasuredSphere(std::vector<uint8_t> its_pixels) : pixels(std::move(its_pixels)) {
    markers.StartImage();
    markers.StartSearch(1, 1e6);
    const Blob blob = SphereBlob();
    good = markers.Measure(View(), {&blob, 1}, 0)->good;
  }
  ImageView View() const { return {pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8}; }

  std::vector<uint8_t> pixels;
  MeasuredMarkers markers;
  bool good = false;
};

// Here no pixel is brighter than its background.
TEST(MeasuredMarkers, FitsASphereBeforeASaturatedWindow) {
  const double colour[3] = {70, 95, 120};
  MeasuredSphere sphere(Render([&](double share, int, int, int k) {
    return std::min(255.0, share * colour[k] + (1 - share) * 900);
  }));
  ASSERT_TRUE(sphere.good);
  const auto& outline = sphere.markers.OutlineOf(sphere.View(), 0);
  ASSERT_TRUE(IsOnOutline(outline));
  EXPECT_LT((outline->centre_px - kTruePx).norm(), 0.05);
  EXPECT_TRUE(sphere.markers.OfBlob(0).pixels.IsOutshone());
}

}  // namespace
}  // namespace rigcal::agent::measured_markers_test
