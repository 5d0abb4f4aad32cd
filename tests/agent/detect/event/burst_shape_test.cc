// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/burst_shape.h"

#include <gtest/gtest.h>

#include <cmath>

namespace rigcal::agent::burst_shape_test {
namespace {

PixelList Disc(double x, double y, double radius) {
  PixelList pixels;
  for (int v = -40; v <= 40; ++v) {
    for (int u = -40; u <= 40; ++u) {
      if (std::hypot(u - x, v - y) <= radius) pixels.emplace_back(u, v);
    }
  }
  return pixels;
}

TEST(BurstShape, OfADisc) {
  PixelList pixels = Disc(1.3, -2.6, 9.4);
  const size_t count = pixels.size();
  const Blob shape = MarkerShapeOf(&pixels);
  EXPECT_LT((shape.centre_px - Eigen::Vector2d(1.3, -2.6)).norm(), 0.05);
  EXPECT_NEAR(RadiusPx(shape), 9.4, 0.1);
  EXPECT_NEAR(shape.second_moment_px2(0, 0), 9.4 * 9.4 / 4, 1);
  EXPECT_NEAR(shape.second_moment_px2(0, 1), 0, 0.5);
  EXPECT_FALSE(IsLong(shape));
  EXPECT_EQ(pixels.size(), count);
}

TEST(BurstShape, WhatStandsOutIsNoPartOfAMarker) {
  PixelList pixels = Disc(0.2, 0.4, 10);
  const size_t count = pixels.size();
  for (int x = 11; x < 18; ++x) {
    for (int y = -2; y < 3; ++y) pixels.emplace_back(x, y);
  }
  const double all_x = ShapeOf(pixels).centre_px.x();
  const Blob shape = MarkerShapeOf(&pixels);
  EXPECT_GT(all_x, 1.2);
  EXPECT_LT((shape.centre_px - Eigen::Vector2d(0.2, 0.4)).norm(), 0.35);
  EXPECT_LT(pixels.size(), count + 12);
  EXPECT_EQ(shape.area_px, static_cast<int>(pixels.size()));
}

TEST(BurstShape, TwoDiscsAreLongAndStayWhole) {
  PixelList pixels = Disc(0, 0, 6);
  for (const auto& pixel : Disc(30, 0, 6)) pixels.push_back(pixel);
  const size_t count = pixels.size();
  const Blob shape = MarkerShapeOf(&pixels);
  EXPECT_TRUE(IsLong(shape));
  EXPECT_EQ(pixels.size(), count);
}

TEST(BurstShape, OnePixelAndARow) {
  PixelList one = {{5, 7}};
  EXPECT_EQ(MarkerShapeOf(&one).centre_px, Eigen::Vector2d(5, 7));
  EXPECT_EQ(one.size(), 1u);
  PixelList row;
  for (int x = 0; x < 9; ++x) row.emplace_back(x, 3);
  EXPECT_TRUE(IsLong(MarkerShapeOf(&row)));
  EXPECT_EQ(row.size(), 9u);
}

}  // namespace
}  // namespace rigcal::agent::burst_shape_test
