// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/disc_splitter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent::disc_splitter_test {
namespace {

PixelList Discs(const std::vector<double>& centres_x, double radius) {
  PixelList pixels;
  for (int y = -20; y <= 20; ++y) {
    for (int x = -20; x <= 80; ++x) {
      bool inside = false;
      for (const double centre : centres_x) inside |= std::hypot(x - centre, y) <= radius;
      if (inside) pixels.emplace_back(x, y);
    }
  }
  return pixels;
}

double MeanX(const PixelList& pixels) {
  double sum = 0;
  for (const auto& pixel : pixels) sum += pixel.first;
  return sum / static_cast<double>(pixels.size());
}

TEST(DiscSplitter, LeavesOneDiscAlone) {
  DiscSplitter splitter;
  const PixelList disc = Discs({0}, 7.3);
  ASSERT_EQ(splitter.Split(disc, 8).size(), 1u);
  EXPECT_EQ(splitter.Split(disc, 8)[0], disc);
  EXPECT_TRUE(splitter.Split({}, 8).empty());
}

TEST(DiscSplitter, TakesTwoAndThreeApart) {
  DiscSplitter splitter;
  EXPECT_EQ(splitter.Split(Discs({0, 13}, 7.3), 8).size(), 2u);
  const auto& parts = splitter.Split(Discs({0, 13, 26}, 7.3), 8);
  ASSERT_EQ(parts.size(), 3u);
  double sum = 0;
  for (const PixelList& part : parts) sum += MeanX(part);
  EXPECT_NEAR(sum, 39, 0.5);
}

TEST(DiscSplitter, DropsPartsThatAreTooSmall) {
  DiscSplitter splitter;
  EXPECT_TRUE(splitter.Split(Discs({0, 13}, 7.3), 1000).empty());
}

TEST(DiscSplitter, TakesApartByTheLowestLevelOfMostParts) {
  // Two that hang together thickly, and a third by a thread.
  PixelList pixels = Discs({0, 11}, 7.3);
  for (const auto& [x, y] : Discs({40}, 7.3)) pixels.emplace_back(x, y);
  for (int x = 19; x <= 32; ++x) pixels.emplace_back(x, 0);
  DiscSplitter splitter;
  const auto& parts = splitter.Split(pixels, 8);
  ASSERT_EQ(parts.size(), 3u);
  size_t count = 0;
  for (const PixelList& part : parts) count += part.size();
  EXPECT_EQ(count, pixels.size());
}

TEST(DiscSplitter, LeavesAWholeScreenAndAFieldOfDiscsAlone) {
  PixelList screen, field;
  for (int y = 0; y < 720; ++y) {
    for (int x = 0; x < 1280; ++x) {
      screen.emplace_back(x, y);
      // Discs of radius 5 on a lattice of bridges.
      const int u = x % 12 - 6, v = y % 12 - 6;
      if (u * u + v * v <= 25 || u == 0 || v == 0) field.emplace_back(x, y);
    }
  }
  DiscSplitter splitter;
  EXPECT_EQ(splitter.Split(screen, 8).size(), 1u);
  ASSERT_EQ(splitter.Split(field, 8).size(), 1u);
  EXPECT_EQ(splitter.Split(field, 8)[0], field);
}

}  // namespace
}  // namespace rigcal::agent::disc_splitter_test
