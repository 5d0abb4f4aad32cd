// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/blob_splitter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "agent/detect/blobs/blob_contrast.h"

namespace rigcal::agent::blob_splitter_test {
namespace {

constexpr int kSize = 80;

struct Image {
  std::vector<uint8_t> pixels = std::vector<uint8_t>(kSize * kSize, 10);
  void Disc(double x0, double y0, double radius, uint8_t grey) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        if (std::hypot(x - x0, y - y0) < radius) pixels[static_cast<size_t>(y * kSize + x)] = grey;
      }
    }
  }
  ImageView View() const { return {pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8}; }
  Blob Find() const {
    BlobFinderOptions options;
    options.colour.value_min = 60;
    auto finder = BlobFinder::Create(options);
    const BlobResult& result = finder->Find(View());
    EXPECT_EQ(result.blobs.size(), 1u);
    return result.blobs.at(0);
  }
};

TEST(BlobSplitter, FindsTheMarkerInFrontOfSomethingDimmer) {
  Image image;
  image.Disc(40, 40, 20, 80);
  image.Disc(56, 40, 7, 200);
  BlobSplitter splitter;
  const auto& parts = splitter.Split(image.View(), image.Find(), 6);
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_NEAR(parts[0].centre_px.x(), 56, 0.2);
  EXPECT_NEAR(parts[0].centre_px.y(), 40, 0.2);
  EXPECT_TRUE(IsRound(parts[0]));
}

// Red is clipped in both, a sphere and a screen behind it.
TEST(BlobSplitter, FindsAClippedMarkerByItsOtherChannels) {
  std::vector<uint8_t> pixels(kSize * kSize * 3, 5);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      uint8_t* const pixel = &pixels[static_cast<size_t>((y * kSize + x) * 3)];
      if (x < 60 && y > 26 && y < 54) pixel[0] = 10, pixel[1] = 25, pixel[2] = 255;
      if (std::hypot(x - 56, y - 40) < 7) pixel[0] = 40, pixel[1] = 150, pixel[2] = 255;
    }
  }
  const ImageView view{pixels.data(), kSize, kSize, 3 * kSize, PixelFormat::kBgr8};
  auto finder = BlobFinder::Create({.colour = {.hue_min_deg = 0, .hue_max_deg = 50}});
  ASSERT_TRUE(finder.ok());
  const BlobResult& found = finder->Find(view);
  ASSERT_EQ(found.blobs.size(), 1u);
  BlobSplitter splitter;
  const auto& parts = splitter.Split(view, found.blobs[0], 6);
  EXPECT_TRUE(std::ranges::any_of(parts, [](const Blob& part) {
    return IsRound(part) && (part.centre_px - Eigen::Vector2d(56, 40)).norm() < 0.2;
  }));
}

TEST(BlobSplitter, TakesTwoMarkersApart) {
  Image image;
  image.Disc(37.5, 40, 2.2, 140);  // the bridge of their blur
  image.Disc(30, 40, 7, 200);
  image.Disc(45, 40, 7, 200);
  const Blob both = image.Find();
  EXPECT_FALSE(IsRound(both));
  BlobSplitter splitter;
  EXPECT_EQ(splitter.Split(image.View(), both, 6).size(), 2u);
}

TEST(BlobSplitter, OneDiscStaysOne) {
  Image image;
  image.Disc(40, 40, 9, 200);
  const Blob blob = image.Find();
  EXPECT_TRUE(IsRound(blob));
  BlobSplitter splitter;
  const auto& parts = splitter.Split(image.View(), blob, 6);
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].area_px, blob.area_px);
}

TEST(StandsOut, TellsALampFromTheBrighterPartOfAWall) {
  Image image;
  image.Disc(40, 40, 8, 200);
  EXPECT_TRUE(StandsOut(image.View(), image.Find()).has_value());
  Image wall;
  wall.pixels.assign(wall.pixels.size(), 50);
  wall.Disc(40, 40, 8, 70);
  EXPECT_FALSE(StandsOut(wall.View(), wall.Find()).has_value());
}

}  // namespace
}  // namespace rigcal::agent::blob_splitter_test
