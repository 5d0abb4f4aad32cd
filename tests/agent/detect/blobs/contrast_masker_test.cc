// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/contrast_masker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

namespace rigcal::agent::contrast_masker_test {
namespace {

using Bgr = std::array<int, 3>;

struct Picture {
  Picture(int columns, int rows, PixelFormat its_format)
      : width(columns),
        height(rows),
        format(its_format),
        bytes(static_cast<size_t>(columns * rows * BytesPerPixel(its_format))) {}

  uint8_t* Pixel(int x, int y) {
    return bytes.data() + static_cast<ptrdiff_t>(y * width + x) * BytesPerPixel(format);
  }
  ImageView View() const {
    return {bytes.data(), width, height, ptrdiff_t{width} * BytesPerPixel(format), format};
  }

  int width, height;
  PixelFormat format;
  std::vector<uint8_t> bytes;
};

// Red less blue, or brightness, summed over 2 x 2 pixels.
int BlockOf(Picture* picture, int x, int y) {
  int sum = 0;
  for (int v = 0; v < 2; ++v) {
    for (int u = 0; u < 2; ++u) {
      const uint8_t* const pixel = picture->Pixel(x + u, y + v);
      sum += picture->format == PixelFormat::kBgr8 ? pixel[2] - pixel[0] : pixel[0];
    }
  }
  return sum;
}

// Whether a block is more than the mean around it by what is needed where there is much noise.
bool IsMore(Picture* picture, int column, int row) {
  const int columns = picture->width / 2, rows = picture->height / 2;
  if (column < 0 || row < 0 || column >= columns || row >= rows) return false;
  int64_t sum = 0, count = 0;
  for (int v = std::max(0, row - 8); v <= std::min(rows - 1, row + 8); ++v) {
    for (int u = std::max(0, column - 8); u <= std::min(columns - 1, column + 8); ++u) {
      sum += BlockOf(picture, 2 * u, 2 * v);
      ++count;
    }
  }
  return (BlockOf(picture, 2 * column, 2 * row) - 32) * count > sum;
}

// Whether a block of the image is marked, by the definition.
bool IsMarked(Picture* picture, int column, int row) {
  if (column >= picture->width / 2 || row >= picture->height / 2) return false;
  int more = 0;
  for (int v = -1; v <= 1; ++v) {
    for (int u = -1; u <= 1; ++u) more += IsMore(picture, column + u, row + v) ? 1 : 0;
  }
  return more >= 5;
}

// A part of an image is marked as in the whole: a wand that is followed is found as by a search of
// the whole image.
TEST(ContrastMasker, IsWhatItsDefinitionSays) {
  std::mt19937 random(1);
  ContrastMasker masker(2, 0);
  const std::vector<std::pair<PixelRect, PixelRect>> cases = {
      {{0, 0, 140, 40}, {0, 0, 140, 40}},  {{0, 0, 97, 31}, {0, 0, 97, 31}},
      {{0, 0, 300, 90}, {101, 33, 37, 5}}, {{0, 0, 300, 91}, {200, 60, 100, 31}},
      {{0, 0, 33, 2}, {0, 0, 33, 2}},      {{0, 0, 70, 5}, {64, 0, 6, 5}}};
  int marked = 0;
  for (const auto& [size, part] : cases) {
    for (const PixelFormat format : {PixelFormat::kBgr8, PixelFormat::kMono8}) {
      Picture picture(size.width, size.height, format);
      for (uint8_t& byte : picture.bytes) byte = static_cast<uint8_t>(random());
      const PixelMask& mask = masker.Mask(picture.View(), part);
      for (int y = part.y; y < part.y + part.height; ++y) {
        for (int x = part.x; x < part.x + part.width; ++x) {
          const bool expected = IsMarked(&picture, x / 2, y / 2);
          marked += expected ? 1 : 0;
          ASSERT_EQ(mask.Get(x, y), expected) << x << " " << y;
        }
      }
    }
  }
  EXPECT_GT(marked, 0);
}

// What has been marked in another picture, or in another part, is gone.
TEST(ContrastMasker, ForgetsTheLastPicture) {
  ContrastMasker masker(2, 0);
  Picture picture(192, 20, PixelFormat::kBgr8);
  for (int y = 8; y < 14; ++y) {
    for (int x = 60; x < 66; ++x) picture.Pixel(x, y)[2] = 255;
  }
  EXPECT_GT(masker.Mask(picture.View(), picture.View().Bounds()).CountPixels(), 0);
  picture.bytes.assign(picture.bytes.size(), 0);
  EXPECT_EQ(masker.Mask(picture.View(), {64, 0, 100, 20}).CountPixels(), 0);
  EXPECT_EQ(masker.Mask(picture.View(), picture.View().Bounds()).CountPixels(), 0);
  EXPECT_EQ(masker.Mask(picture.View(), {0, 0, 1, 1}).CountPixels(), 0);
}

// A sphere's light adds to a wall of whatever colour; a white thing adds none of that colour.
TEST(ContrastMasker, MarksWhatAddsItsColour) {
  ContrastMasker masker(2, 0);
  const auto share_marked = [&](const Bgr& wall, const Bgr& added) {
    Picture picture(160, 120, PixelFormat::kBgr8);
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        const bool inside = std::hypot(x - 80, y - 60) < 8;
        for (size_t k = 0; k < 3; ++k) {
          picture.Pixel(x, y)[k] = static_cast<uint8_t>(wall[k] + (inside ? added[k] : 0));
        }
      }
    }
    const PixelMask& mask = masker.Mask(picture.View(), picture.View().Bounds());
    int outside = 0, inside = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        if (!mask.Get(x, y)) continue;
        (std::hypot(x - 80, y - 60) < 9 ? inside : outside) += 1;
      }
    }
    EXPECT_EQ(outside, 0);
    return inside / 201.0;
  };
  for (const Bgr& wall : {Bgr{10, 10, 10}, Bgr{120, 125, 130}, Bgr{60, 100, 140}}) {
    EXPECT_NEAR(share_marked(wall, {3, 9, 18}), 1, 0.15);
    EXPECT_EQ(share_marked(wall, {60, 60, 60}), 0);
    EXPECT_EQ(share_marked(wall, {18, 9, 3}), 0);
  }
}

// A dim sphere is whole where noise is low; where it is not, noise alone marks next to nothing.
TEST(ContrastMasker, NoiseSaysHowMuchMoreIsMore) {
  const auto marked = [](double noise_grey, int added) {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, noise_grey);
    Picture picture(320, 240, PixelFormat::kBgr8);
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        const bool inside = std::hypot(x - 160, y - 120) < 8;
        for (int k = 0; k < 3; ++k) {
          const double grey = 40 + (inside && k == 2 ? added : 0) + noise(random);
          picture.Pixel(x, y)[k] = static_cast<uint8_t>(std::lround(grey));
        }
      }
    }
    ContrastMasker masker(2, 0);
    const PixelMask& mask = masker.Mask(picture.View(), picture.View().Bounds());
    int outside = 0, inside = 0;
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) {
        if (mask.Get(x, y)) (std::hypot(x - 160, y - 120) < 10 ? inside : outside) += 1;
      }
    }
    EXPECT_LT(outside, 0.001 * 320 * 240) << noise_grey;
    return inside / 201.0;
  };
  EXPECT_NEAR(marked(1, 6), 0.9, 0.15);
  EXPECT_LT(marked(4, 6), 0.5);
  EXPECT_NEAR(marked(4, 16), 0.9, 0.15);
}

}  // namespace
}  // namespace rigcal::agent::contrast_masker_test
