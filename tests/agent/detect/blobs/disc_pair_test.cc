// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/disc_pair.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent::disc_pair_test {
namespace {

constexpr int kSize = 100;

// The blob of the pixels that are `inside`.
template <typename Inside>
Blob BlobOf(Inside inside) {
  std::vector<uint8_t> pixels(kSize * kSize, 10);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      if (inside(x, y)) pixels[static_cast<size_t>(y * kSize + x)] = 200;
    }
  }
  BlobFinderOptions options;
  options.colour.value_min = 60;
  auto finder = BlobFinder::Create(options);
  const auto& result =
      finder->Find(ImageView{pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8});
  EXPECT_EQ(result.blobs.size(), 1u);
  return result.blobs.at(0);
}

bool InDisc(int x, int y, double x0, double y0, double radius) {
  return std::hypot(x - x0, y - y0) < radius;
}

TEST(DiscPair, FindsDiscsThatOverlapOrTouch) {
  for (const double apart : {12.0, 16.0, 20.0}) {
    const double dx = 0.4 * apart, dy = 0.3 * apart;
    const auto discs = SplitPair(BlobOf([&](int x, int y) {
      return InDisc(x, y, 50 - dx, 50 - dy, 10) || InDisc(x, y, 50 + dx, 50 + dy, 10);
    }));
    ASSERT_TRUE(discs) << apart;
    for (const Blob& disc : *discs) {
      const double side = disc.centre_px.x() < 50 ? -1 : 1;
      EXPECT_NEAR(disc.centre_px.x(), 50 + side * dx, 0.5) << apart;
      EXPECT_NEAR(disc.centre_px.y(), 50 + side * dy, 0.5) << apart;
      EXPECT_NEAR(std::sqrt(disc.area_px / 3.14159), 10, 0.4) << apart;
    }
  }
}

// By a stick that points at the camera.
TEST(DiscPair, ToleratesHolesAndNotches) {
  const auto discs = SplitPair(BlobOf([&](int x, int y) {
    if (InDisc(x, y, 57, 52, 3) || (std::abs(y - 50) < 2 && x < 43)) return false;
    return InDisc(x, y, 42, 50, 10) || InDisc(x, y, 58, 50, 10);
  }));
  ASSERT_TRUE(discs);
  for (const Blob& disc : *discs) {
    const double side = disc.centre_px.x() < 50 ? -1 : 1;
    EXPECT_NEAR(disc.centre_px.x(), 50 + side * 8, 2);
    EXPECT_NEAR(disc.centre_px.y(), 50, 1);
    EXPECT_NEAR(std::sqrt(disc.area_px / 3.14159), 10, 1);
  }
}

TEST(DiscPair, OneDiscAndALongBarAreNone) {
  EXPECT_FALSE(SplitPair(BlobOf([](int x, int y) { return InDisc(x, y, 50, 50, 10); })));
  // One that moves by a third of its radius.
  EXPECT_FALSE(SplitPair(BlobOf([](int x, int y) {
    return InDisc(x, y, 48, 50, 12) || InDisc(x, y, 52, 50, 12) ||
           (std::abs(x - 50) <= 2 && std::abs(y - 50) < 12);
  })));
  EXPECT_FALSE(
      SplitPair(BlobOf([](int x, int y) { return std::abs(y - 50) < 4 && x > 20 && x < 80; })));
}

}  // namespace
}  // namespace rigcal::agent::disc_pair_test
