// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/third_marker.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace rigcal::agent::third_marker_test {
namespace {

using Grey = std::array<uint8_t, 3>;
constexpr int kSize = 100;
constexpr double kRadius = 8;
constexpr Grey kWall = {34, 60, 92}, kMarker = {40, 70, 105}, kRed = {20, 20, 120};

// A disc of `marker` around (50, 50) before `wall`; right of `from_x` `beside` is behind it.
std::optional<double> CostAt(const Eigen::Vector2d& place, const Grey& marker, const Grey& wall,
                             double from_x = kSize, const Grey& beside = kWall) {
  std::vector<uint8_t> pixels;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const Grey& grey = std::hypot(x - 50, y - 50) < kRadius ? marker : x < from_x ? wall : beside;
      pixels.insert(pixels.end(), grey.begin(), grey.end());
    }
  }
  const ImageView view{pixels.data(), kSize, kSize, ptrdiff_t{3} * kSize, PixelFormat::kBgr8};
  double work = 1000;
  const auto cost = ThirdMarkerCost(
      view, place, kRadius, {float{kMarker[0]}, float{kMarker[1]}, float{kMarker[2]}}, &work);
  EXPECT_LT(work, 1000);
  return cost;
}

// Of nearly the same colour as what is behind it, which is why nothing found it.
TEST(ThirdMarkerCost, ADiscOfTheOthersLookMayBeOne) {
  const auto cost = CostAt({50, 50}, kMarker, kWall);
  ASSERT_TRUE(cost.has_value());
  EXPECT_LT(*cost, 0.1);
}

TEST(ThirdMarkerCost, AWallOfTheirColourIsNone) {
  EXPECT_FALSE(CostAt({50, 50}, kMarker, kMarker).has_value());
  EXPECT_FALSE(CostAt({50, 50}, kMarker, kWall, 51, kMarker).has_value());  // nor the end of one
  EXPECT_TRUE(CostAt({50, 50}, kMarker, kWall, 55, kMarker).has_value());
}

TEST(ThirdMarkerCost, AnotherColourOrBrightnessIsNone) {
  EXPECT_FALSE(CostAt({50, 50}, kRed, kWall).has_value());
  EXPECT_FALSE(CostAt({50, 50}, {8, 14, 21}, kWall).has_value());
  EXPECT_FALSE(CostAt({20, 50}, kMarker, {0, 0, 0}).has_value());  // it is elsewhere
}

TEST(ThirdMarkerCost, OneThatTheImageCutsIsNone) {
  std::vector<uint8_t> pixels(size_t{3} * kSize * kSize, 12);
  const ImageView view{pixels.data(), kSize, kSize, ptrdiff_t{3} * kSize, PixelFormat::kBgr8};
  for (const auto& [x, y] :
       {std::array{4.0, 50.0}, {97.0, 50.0}, {50.0, 4.0}, {50.0, 97.0}, {-900.0, 50.0}}) {
    double work = 1000;
    EXPECT_FALSE(ThirdMarkerCost(view, {x, y}, kRadius, {12, 12, 12}, &work).has_value());
    EXPECT_EQ(work, 1000);
  }
}

}  // namespace
}  // namespace rigcal::agent::third_marker_test
