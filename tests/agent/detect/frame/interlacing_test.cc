// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/interlacing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace rigcal::agent::interlacing_test {
namespace {

constexpr int kSize = 64;

// A disc that is `apart_px` further right in odd rows.
std::vector<uint8_t> Disc(double radius_px, double apart_px, double noise_grey) {
  std::vector<uint8_t> pixels(kSize * kSize);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 1);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double centre = 30.2 + (y % 2 == 1 ? apart_px : 0);
      const double cover = std::clamp(radius_px + 0.5 - std::hypot(x - centre, y - 31.4), 0.0, 1.0);
      const double grey = 10 + 150 * cover + noise_grey * noise(random);
      pixels[static_cast<size_t>(y * kSize + x)] =
          static_cast<uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
    }
  }
  return pixels;
}

bool Looks(double radius_px, double apart_px, double noise_grey = 2) {
  const std::vector<uint8_t> pixels = Disc(radius_px, apart_px, noise_grey);
  BlobFinderOptions options;

  auto finder = BlobFinder::Create(options);
  EXPECT_TRUE(finder.ok());
  const ImageView image{pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8};
  const BlobResult& found = finder->Find(image);
  EXPECT_FALSE(found.blobs.empty());
  return LooksInterlaced(image, found.blobs);
}

TEST(LooksInterlaced, TellsTeethFromEdges) {
  for (const double radius_px : {5.0, 9.0, 16.0}) {
    EXPECT_FALSE(Looks(radius_px, 0)) << radius_px;
    EXPECT_FALSE(Looks(radius_px, 0.2)) << radius_px;
    EXPECT_FALSE(Looks(radius_px, 0, 10)) << radius_px;
    for (const double apart_px : {1.5, 4.0, 8.0, -6.0}) {
      EXPECT_TRUE(Looks(radius_px, apart_px)) << radius_px << ' ' << apart_px;
    }
  }
}

TEST(LooksInterlaced, NothingToLookAt) {
  const std::vector<uint8_t> pixels = Disc(9, 4, 0);
  const ImageView image{pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8};
  EXPECT_FALSE(LooksInterlaced(image, {}));
  Blob whole;
  whole.area_px = 5000;
  whole.box = {0, 0, kSize, kSize};
  EXPECT_TRUE(LooksInterlaced(image, {whole}));
}

}  // namespace
}  // namespace rigcal::agent::interlacing_test
