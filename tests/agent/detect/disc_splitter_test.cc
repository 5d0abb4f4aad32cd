// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/disc_splitter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent {
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

}  // namespace
}  // namespace rigcal::agent
