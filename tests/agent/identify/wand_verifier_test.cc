// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_verifier.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "tests/agent/identify/paper_wand_view.h"

namespace rigcal::agent::wand_verifier_test {
namespace {

// At 4 m, across the line of sight.
constexpr double kRadiusPx = 5, kFirstX = 250.3, kY = 240.2;
constexpr std::array<double, 3> kAlongPx = {0, 32.5, 97.5};

WandCandidate Whole() {
  WandCandidate candidate;
  candidate.blobs = {0, 1, 2};
  return candidate;
}

// Of what an image shows of a wand that is `scale` times as large.
std::optional<VerifiedWand> Verified(const std::vector<uint8_t>& pixels,
                                     const std::array<double, 3>& radii_px, double scale,
                                     bool in_room, const WandCandidate& candidate = Whole()) {
  const ImageView image{pixels.data(), kViewWidth, kViewHeight, 3 * kViewWidth, PixelFormat::kBgr8};
  std::vector<Blob> blobs;
  for (size_t k = 0; k < radii_px.size(); ++k) {
    Blob& blob = blobs.emplace_back();
    blob.centre_px = {kFirstX + scale * kAlongPx[k], kY};
    blob.second_moment_px2 = 0.25 * radii_px[k] * radii_px[k] * Eigen::Matrix2d::Identity();
    blob.area_px = static_cast<int>(3.14 * radii_px[k] * radii_px[k]);
  }
  const WandFinder finder({}, PaperWand(), ViewCamera());
  WandVerifier verifier(0.02);
  verifier.StartImage();
  double work = 1e6;
  return verifier.Verify(image, blobs, finder, {&candidate, 1}, in_room, &work).wand;
}

// Of a wand whose first sphere looks smaller than the others, before `behind_first`. A stick of
// `stick` times their light, 2 px thick, goes on beside all of them.
std::optional<VerifiedWand> Verified(double first_radius_px, double behind_first,
                                     double stick = 0) {
  const std::array<double, 3> colour = {40, 95, 175},
                              radii_px = {first_radius_px, kRadiusPx, kRadiusPx};
  std::vector<uint8_t> pixels;
  for (int y = 0; y < kViewHeight; ++y) {
    for (int x = 0; x < kViewWidth; ++x) {
      double share = 0;
      for (size_t k = 0; k < radii_px.size(); ++k) {
        const double outside_px = std::hypot(x - kFirstX - kAlongPx[k], y - kY) - radii_px[k];
        share += 0.5 * std::erfc(outside_px / (0.6 * std::sqrt(2.0)));
      }
      if (std::abs(y - kY) < 1) share = std::max(share, stick);
      const double behind = x < kFirstX + 0.5 * kAlongPx[1] ? behind_first : 12;
      for (const double grey : colour) {
        pixels.push_back(static_cast<uint8_t>(std::lround(share * grey + (1 - share) * behind)));
      }
    }
  }
  return Verified(pixels, radii_px, 1, false);
}

TEST(WandVerifier, SpheresOfOneSizeFitTheirPose) {
  const auto wand = Verified(kRadiusPx, 12);
  ASSERT_TRUE(wand.has_value());
  EXPECT_LT(wand->fit.cost, 1);
  const auto smaller = Verified(3.9, 12);
  EXPECT_TRUE(!smaller || smaller->fit.cost > 4);
}

// Pixels that the background reaches into are as white as it is, so the outline is further in.
TEST(WandVerifier, ASphereBeforeASaturatedBackgroundMayLookSmaller) {
  const auto wand = Verified(3.9, 255);
  ASSERT_TRUE(wand.has_value());
  EXPECT_LT(wand->fit.cost, 1.5);
}

// Of a dim wand in a lit room, `scale` times as large, before a wall of `wall` grey levels. White
// light makes the upper rims of its spheres `shading` grey levels brighter than their middles.
std::optional<VerifiedWand> VerifiedInRoom(double scale, double wall, double white,
                                           double shading) {
  constexpr std::array<double, 3> kLight = {6, 20, 50};
  const double radius_px = scale * kRadiusPx;
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 3.6);
  std::vector<uint8_t> pixels;
  for (int y = 0; y < kViewHeight; ++y) {
    for (int x = 0; x < kViewWidth; ++x) {
      double share = 0;
      for (const double along_px : kAlongPx) {
        const double outside_px = std::hypot(x - kFirstX - scale * along_px, y - kY) - radius_px;
        share += 0.5 * std::erfc(outside_px / (0.6 * std::sqrt(2.0)));
      }
      const double reflected = white - shading * (y - kY) / radius_px;
      for (const double light : kLight) {
        const double grey = share * (light + reflected) + (1 - share) * wall + noise(random);
        pixels.push_back(static_cast<uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0))));
      }
    }
  }
  return Verified(pixels, {radius_px, radius_px, radius_px}, scale, true);
}

// Noise is all that their outlines leave, but of dim spheres it is as much as small things leave.
TEST(WandVerifier, OutlinesOfLargeDimSpheresCostNothing) {
  const auto wand = VerifiedInRoom(1.6, 20, 20, 0);
  ASSERT_TRUE(wand.has_value());
  EXPECT_EQ(wand->OccludedCount(), 0);
  const auto small = VerifiedInRoom(1, 20, 20, 0);
  ASSERT_TRUE(small.has_value());
  EXPECT_LT(small->log_odds, wand->log_odds - 0.4);
}

}  // namespace
}  // namespace rigcal::agent::wand_verifier_test
