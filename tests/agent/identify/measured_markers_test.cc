// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/measured_markers.h"

#include <gtest/gtest.h>

#include <cmath>
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

// A sphere in front of something grey that ends 2.5 px beside it, where it is dark.
TEST(MeasuredMarkers, FitsAgainstWhatIsRightBesideASphere) {
  constexpr int kSize = 64;
  constexpr double kRadius = 8;
  const Eigen::Vector2d true_px(31.3, 32.8);
  const double colour[3] = {40, 95, 175};
  std::vector<uint8_t> pixels(kSize * kSize * 3);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double outside_px = (Eigen::Vector2d(x, y) - true_px).norm() - kRadius;
      const double share = 0.5 * std::erfc(outside_px / (0.7 * std::sqrt(2.0)));
      const double behind = x < true_px.x() + kRadius + 2.5 ? 50 : 5;
      for (int k = 0; k < 3; ++k) {
        pixels[static_cast<size_t>((y * kSize + x) * 3 + k)] =
            static_cast<uint8_t>(std::lround(share * colour[k] + (1 - share) * behind));
      }
    }
  }
  const ImageView image{pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8};
  Blob blob;
  blob.centre_px = true_px + Eigen::Vector2d(0.2, -0.2);
  blob.second_moment_px2 = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
  blob.area_px = 201;
  MeasuredMarkers markers;
  markers.StartImage();
  markers.StartSearch(1, 1e6);
  ASSERT_TRUE(markers.Measure(image, {&blob, 1}, 0)->good);
  ASSERT_TRUE(markers.OutlineOf(image, 0).has_value());
  EXPECT_GT((markers.OutlineOf(image, 0)->centre_px - true_px).norm(), 0.05);
  markers.FitBeside(image, 0);
  EXPECT_LT((markers.OutlineOf(image, 0)->centre_px - true_px).norm(), 0.04);
}

}  // namespace
}  // namespace rigcal::agent::measured_markers_test
