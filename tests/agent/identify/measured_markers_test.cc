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

TEST(IsOnOutline, OfTheSizeThatOthersSayLessIsEnough) {
  SphereOutline outline;
  outline.radius_px = 8;
  outline.on_outline = 7.0 / 16;
  EXPECT_FALSE(IsOnOutline(outline));
  outline.by_others = true;
  EXPECT_TRUE(IsOnOutline(outline));
  outline.off_outline = 1.0 / 16;
  EXPECT_FALSE(IsOnOutline(outline));
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
    markers.RequireContrast(14);
    const Blob blob = SphereBlob();
    good = markers.Measure(View(), {&blob, 1}, 0)->good;
  }
  ImageView View() const { return {pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8}; }

  std::vector<uint8_t> pixels;
  MeasuredMarkers markers;
  bool good = false;
};

// A sphere in front of something grey that ends 2.5 px beside it, where it is dark.
TEST(MeasuredMarkers, FitsAgainstWhatIsRightBesideASphere) {
  const double colour[3] = {40, 95, 175};
  MeasuredSphere sphere(Render([&](double share, int x, int, int k) {
    return share * colour[k] + (1 - share) * (x < kTruePx.x() + kRadius + 2.5 ? 50 : 5);
  }));
  ASSERT_TRUE(sphere.good);
  ASSERT_TRUE(sphere.markers.OutlineOf(sphere.View(), 0).has_value());
  EXPECT_GT((sphere.markers.OutlineOf(sphere.View(), 0)->centre_px - kTruePx).norm(), 0.05);
  sphere.markers.FitBeside(sphere.View(), 0);
  EXPECT_LT((sphere.markers.OutlineOf(sphere.View(), 0)->centre_px - kTruePx).norm(), 0.04);
}

// Two things behind a sphere: near the border between them nothing says what is behind a pixel, of
// which it is seen more the further out that is.
TEST(MeasuredMarkers, PixelsAreUnsureWhereTheBackgroundChanges) {
  constexpr double kBorderX = 34.5;
  const double colour[3] = {40, 95, 175};
  MeasuredSphere sphere(Render([&](double share, int x, int, int k) {
    return share * colour[k] + (1 - share) * (x < kBorderX ? 60 : 5);
  }));
  ASSERT_TRUE(sphere.good);
  ASSERT_TRUE(sphere.markers.OutlineOf(sphere.View(), 0).has_value());
  sphere.markers.FitBeside(sphere.View(), 0);
  const OutlinePixels& pixels = sphere.markers.OfBlob(0).pixels;
  int near_count = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (!(pixels.precision[i] > 0)) continue;
    const Eigen::Vector2d at_px(static_cast<double>(pixels.x[i]), static_cast<double>(pixels.y[i]));
    const double outside_px = (at_px - kTruePx).norm() - kRadius;
    const double to_border_px = std::abs(at_px.x() - kBorderX);
    if (outside_px < -1.5 || to_border_px > 4) {
      EXPECT_EQ(pixels.unsure[i], 0) << at_px.transpose();
    } else if (outside_px > 0.5 && to_border_px < 1) {
      EXPECT_GT(pixels.unsure[i], 0.1f) << at_px.transpose();
      ++near_count;
    }
  }
  EXPECT_GT(near_count, 4);
}

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

// A sphere of its own `light` before a `wall`, on which white light from above is as bright as that
// in its middle, and brighter by `shading` at its top.
std::vector<uint8_t> BeforePaleWall(const std::array<double, 3>& light, double wall,
                                    double shading) {
  return Render([&](double share, int, int y, int k) {
    const double white = wall - shading * (y - kTruePx.y()) / kRadius;
    return share * (light[static_cast<size_t>(k)] + white) + (1 - share) * wall;
  });
}

// White light from above on a sphere in front of a pale wall, of which its lower half is as bright:
// the outline of what differs is that of a smaller sphere.
TEST(MeasuredMarkers, ColourShowsTheWholeOfASphereBeforeAPaleWall) {
  MeasuredSphere sphere(BeforePaleWall({4, 14, 36}, 100, 45));
  ASSERT_TRUE(sphere.good);
  const std::optional<SphereOutline> bright = sphere.markers.OutlineOf(sphere.View(), 0);
  const std::optional<SphereOutline> coloured = sphere.markers.OutlineByColour(sphere.View(), 0);
  ASSERT_TRUE(coloured.has_value());
  EXPECT_LT((coloured->centre_px - kTruePx).norm(), 0.05);
  EXPECT_NEAR(coloured->radius_px, kRadius, 0.1);
  EXPECT_FALSE(IsClearlySeen(bright));
  EXPECT_TRUE(IsClearlySeen(coloured));
  // The outline that is measured from now on.
  sphere.markers.PreferColour(sphere.View(), 0);
  EXPECT_EQ(sphere.markers.OutlineOf(sphere.View(), 0)->centre_px, coloured->centre_px);
  EXPECT_TRUE(sphere.markers.OfBlob(0).pixels.by_colour);
  // Its variance is that of colour whenever it is looked at again.
  EXPECT_TRUE(sphere.markers.OutlineOf(sphere.View(), 0)->by_colour);
  EXPECT_TRUE(bright && !bright->by_colour);
}

// Its own light is too weak to be measured pixel by pixel, so that a part of it was measured. What
// found it says where to begin.
TEST(MeasuredMarkers, ColourShowsTheWholeOfASphereOfWhichAPartWasMeasured) {
  MeasuredSphere sphere(BeforePaleWall({1, 5, 14}, 60, 40));
  ASSERT_TRUE(sphere.good);
  EXPECT_LT(sphere.markers.OfBlob(0).centre.radius_px, 0.8 * kRadius);
  const std::optional<SphereOutline> coloured = sphere.markers.OutlineByColour(sphere.View(), 0);
  ASSERT_TRUE(coloured.has_value());
  EXPECT_LT((coloured->centre_px - kTruePx).norm(), 0.1);
  EXPECT_NEAR(coloured->radius_px, kRadius, 0.2);
}

// Before a dark wall the brightness shows all of it.
TEST(MeasuredMarkers, ColourIsNotAskedWhereASphereStandsOut) {
  const double colour[3] = {40, 95, 175};
  MeasuredSphere sphere(
      Render([&](double share, int, int, int k) { return share * colour[k] + (1 - share) * 20; }));
  ASSERT_TRUE(sphere.good);
  EXPECT_FALSE(sphere.markers.OutlineByColour(sphere.View(), 0).has_value());
}

}  // namespace
}  // namespace rigcal::agent::measured_markers_test
