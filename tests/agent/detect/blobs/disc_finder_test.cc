// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/disc_finder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "agent/detect/blobs/blob_shape.h"

namespace rigcal::agent::disc_finder_test {
namespace {

constexpr int kSize = 100;
constexpr int kLeastAreaPx = 6;

struct Image {
  std::vector<uint8_t> pixels = std::vector<uint8_t>(kSize * kSize, 10);

  template <typename Inside>
  void Paint(Inside inside, uint8_t grey = 200) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        if (inside(x, y)) pixels[static_cast<size_t>(y * kSize + x)] = grey;
      }
    }
  }
  void Disc(double x0, double y0, double radius) {
    Paint([&](int x, int y) { return std::hypot(x - x0, y - y0) < radius; });
  }
  ImageView View() const { return {pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8}; }

  std::vector<Blob> Discs() const {
    BlobFinderOptions options;
    options.colour.value_min = 60;
    auto finder = BlobFinder::Create(options);
    const BlobResult& result = finder->Find(View());
    EXPECT_EQ(result.blobs.size(), 1u);
    DiscFinder discs;
    return discs.Find(View(), *finder, result.blobs.at(0), kLeastAreaPx);
  }
};

const Blob* Nearest(const std::vector<Blob>& blobs, double x, double y) {
  const auto away = [&](const Blob& blob) {
    return (blob.centre_px - Eigen::Vector2d(x, y)).squaredNorm();
  };
  const auto best = std::ranges::min_element(blobs, {}, away);
  return best != blobs.end() && away(*best) < 1 ? &*best : nullptr;
}

TEST(DiscFinder, FindsMarkersOnTheirStick) {
  Image image;
  image.Paint([](int x, int y) { return std::abs(y - 50) < 2 && x > 10 && x < 90; });
  image.Disc(30, 50, 7);
  image.Disc(60, 50, 7);
  const std::vector<Blob> discs = image.Discs();
  for (const double x : {30.0, 60.0}) {
    const Blob* const disc = Nearest(discs, x, 50);
    ASSERT_NE(disc, nullptr) << "at " << x;
    EXPECT_TRUE(IsRound(*disc));
    EXPECT_NEAR(std::sqrt(disc->area_px / 3.14159), 7, 0.7);
  }
}

TEST(DiscFinder, FindsAMarkerBesideAFrame) {
  Image image;
  image.Paint([](int x, int) { return x > 70 && x < 76; });
  image.Disc(62, 40, 9);
  EXPECT_NE(Nearest(image.Discs(), 62, 40), nullptr);
}

// The end of a stick that points at the camera.
TEST(DiscFinder, AHoleInAMarkerIsFilled) {
  Image image;
  image.Paint([](int x, int y) { return std::abs(y - 50) < 2 && x > 10 && x < 90; });
  image.Disc(60, 50, 9);
  image.Paint([](int x, int y) { return std::hypot(x - 61, y - 49) < 2.5; }, 10);
  const Blob* const disc = Nearest(image.Discs(), 60, 50);
  ASSERT_NE(disc, nullptr);
  EXPECT_NEAR(std::sqrt(disc->area_px / 3.14159), 9, 0.7);
}

TEST(DiscFinder, ABoardHasNone) {
  Image image;
  image.Paint([](int x, int y) { return x > 5 && x < 95 && y > 40 && y < 52; });
  EXPECT_EQ(Nearest(image.Discs(), 50, 46), nullptr);
}

TEST(DiscFinder, ALineIsNone) {
  Image image;
  image.Paint([](int x, int y) { return y == 50 && x > 20 && x < 80; });
  EXPECT_TRUE(image.Discs().empty());
}

}  // namespace
}  // namespace rigcal::agent::disc_finder_test
