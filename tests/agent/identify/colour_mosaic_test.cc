// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/colour_mosaic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace rigcal::agent::colour_mosaic_test {
namespace {

constexpr int kSize = 32;

struct Picture {
  std::vector<uint8_t> pixels = std::vector<uint8_t>(kSize * kSize * 3);

  uint8_t& At(int x, int y, int channel) {
    return pixels[static_cast<size_t>((y * kSize + x) * 3 + channel)];
  }
  ImageView View() const { return {pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8}; }
};

// An orange disc with noise.
Picture Plain() {
  Picture picture;
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 2);
  constexpr double kColour[] = {40, 100, 180};
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double cover = std::clamp(8.5 - std::hypot(x - 15.3, y - 16.2), 0.0, 1.0);
      for (int c = 0; c < 3; ++c) {
        const double grey = 12 + cover * kColour[c] + noise(random);
        picture.At(x, y, c) = static_cast<uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
      }
    }
  }
  return picture;
}

// Each channel where it is measured, elsewhere the mean of its nearest measured ones.
Picture Interpolated(Picture plain, const ColourMosaic& mosaic) {
  Picture picture = plain;
  for (int y = 1; y + 1 < kSize; ++y) {
    for (int x = 1; x + 1 < kSize; ++x) {
      for (int c = 0; c < 3; ++c) {
        if (mosaic.Channel(x, y) == c) continue;
        int sum = 0, count = 0;
        for (int v = -1; v <= 1; ++v) {
          for (int u = -1; u <= 1; ++u) {
            if (mosaic.Channel(x + u, y + v) != c) continue;
            sum += plain.At(x + u, y + v, c);
            ++count;
          }
        }
        picture.At(x, y, c) = static_cast<uint8_t>((sum + count / 2) / count);
      }
    }
  }
  return picture;
}

TEST(FindMosaic, TellsWhichChannelWasMeasured) {
  for (const int red_x : {0, 1}) {
    for (const int red_y : {0, 1}) {
      const ColourMosaic mosaic{red_x, red_y};
      EXPECT_EQ(mosaic.Channel(red_x, red_y), 2);
      EXPECT_EQ(mosaic.Channel(red_x + 1, red_y + 1), 0);
      EXPECT_EQ(mosaic.Channel(red_x + 1, red_y), 1);
      const Picture picture = Interpolated(Plain(), mosaic);
      const auto found = FindMosaic(picture.View(), {3, 2, 27, 28});
      ASSERT_TRUE(found) << red_x << red_y;
      EXPECT_EQ(found->red_x, red_x);
      EXPECT_EQ(found->red_y, red_y);
    }
  }
}

TEST(FindMosaic, NoneWhereAllChannelsAreMeasuredOrNothingIsToBeSeen) {
  const Picture plain = Plain();
  EXPECT_FALSE(FindMosaic(plain.View(), {0, 0, kSize, kSize}));
  EXPECT_FALSE(FindMosaic(Picture().View(), {0, 0, kSize, kSize}));
  EXPECT_FALSE(FindMosaic(plain.View(), {20, 20, 4, 4}));
  EXPECT_FALSE(FindMosaic(plain.View(), {30, 30, 200, 200}));
  // A mean over neighbours, as scaling and compression take it.
  Picture smooth = Interpolated(plain, {});
  Picture from = smooth;
  for (int y = 0; y + 1 < kSize; ++y) {
    for (int x = 0; x + 1 < kSize; ++x) {
      for (int c = 0; c < 3; ++c) {
        smooth.At(x, y, c) =
            static_cast<uint8_t>((from.At(x, y, c) + from.At(x + 1, y, c) + from.At(x, y + 1, c) +
                                  from.At(x + 1, y + 1, c)) /
                                 4);
      }
    }
  }
  EXPECT_FALSE(FindMosaic(smooth.View(), {0, 0, kSize, kSize}));
}

// Colour at half the resolution, interpolated, as decoders of JPEG and H.264 return it.
Picture Subsampled(const Picture& plain) {
  constexpr int kHalf = kSize / 2;
  std::vector<double> luma(kSize * kSize), half(kHalf * kHalf * 3);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const size_t i = static_cast<size_t>(y * kSize + x);
      for (size_t c = 0; c < 3; ++c) luma[i] += kLuma[c] * plain.pixels[3 * i + c];
      for (size_t c = 0; c < 3; ++c) {
        half[static_cast<size_t>(y / 2 * kHalf + x / 2) * 3 + c] +=
            0.25 * (plain.pixels[3 * i + c] - luma[i]);
      }
    }
  }
  Picture picture = plain;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      // The nearer of two counts three times.
      const int u = x / 2, v = y / 2;
      const int other_u = std::clamp(x % 2 == 0 ? u - 1 : u + 1, 0, kHalf - 1);
      const int other_v = std::clamp(y % 2 == 0 ? v - 1 : v + 1, 0, kHalf - 1);
      for (int c = 0; c < 3; ++c) {
        const auto at = [&](int column, int row) {
          return half[static_cast<size_t>((row * kHalf + column) * 3 + c)];
        };
        const double difference =
            (9 * at(u, v) + 3 * at(other_u, v) + 3 * at(u, other_v) + at(other_u, other_v)) / 16;
        const double grey = luma[static_cast<size_t>(y * kSize + x)] + difference;
        picture.At(x, y, c) = static_cast<uint8_t>(std::clamp(std::lround(grey), 0l, 255l));
      }
    }
  }
  return picture;
}

TEST(IsColourBlurred, TellsColourAtHalfTheResolution) {
  const PixelRect part{3, 2, 27, 28};
  EXPECT_EQ(IsColourBlurred(Plain().View(), part), std::optional(false));
  EXPECT_EQ(IsColourBlurred(Subsampled(Plain()).View(), part), std::optional(true));
}

TEST(IsColourBlurred, SaysNothingOfGrey) {
  Picture grey = Plain();
  for (size_t i = 0; i < grey.pixels.size(); i += 3) {
    grey.pixels[i] = grey.pixels[i + 1] = grey.pixels[i + 2];
  }
  EXPECT_EQ(IsColourBlurred(grey.View(), {3, 2, 27, 28}), std::nullopt);
  // One channel is as sharp as itself.
  EXPECT_EQ(IsColourBlurred({grey.pixels.data(), kSize, kSize, kSize, PixelFormat::kMono8},
                            {3, 2, 27, 28}),
            std::optional(false));
}

TEST(IsColourBlurred, SurvivesPartsOutsideOfTheImage) {
  EXPECT_EQ(IsColourBlurred(Plain().View(), {0, 0, 0, 0}), std::nullopt);
  EXPECT_EQ(IsColourBlurred(Plain().View(), {-5, -5, 60, 60}), std::optional(false));
}

}  // namespace
}  // namespace rigcal::agent::colour_mosaic_test
