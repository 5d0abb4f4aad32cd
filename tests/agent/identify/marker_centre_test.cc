// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/marker_centre.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace rigcal::agent::marker_centre_test {
namespace {

constexpr int kSize = 64;
constexpr double kBlurPx = 0.6;

// An orange disc over a background, blurred by lens and pixel.
class DiscImage {
 public:
  template <typename Background>
  DiscImage(const Eigen::Vector2d& centre, double radius, double gain, Background background)
      : pixels_(kSize * kSize * 3) {
    constexpr int kSub = 4;
    const double colour[3] = {40, 95, 175};
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        double share = 0;
        for (int v = 0; v < kSub; ++v) {
          for (int u = 0; u < kSub; ++u) {
            const Eigen::Vector2d p(x + (u + 0.5) / kSub - 0.5, y + (v + 0.5) / kSub - 0.5);
            share += 0.5 * std::erfc(((p - centre).norm() - radius) / (kBlurPx * std::sqrt(2.0))) /
                     (kSub * kSub);
          }
        }
        for (int k = 0; k < 3; ++k) {
          const double grey = share * gain * colour[k] + (1 - share) * background(x, y);
          pixels_[static_cast<size_t>((y * kSize + x) * 3 + k)] =
              static_cast<uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
        }
      }
    }
    blob_.centre_px = centre + Eigen::Vector2d(0.3, -0.3);
    blob_.second_moment_px2 = 0.25 * radius * radius * Eigen::Matrix2d::Identity();
    blob_.area_px = static_cast<int>(3.14 * radius * radius);
  }

  std::array<uint8_t, 3> At(int x, int y) const {
    const auto place = static_cast<size_t>((y * kSize + x) * 3);
    return {pixels_[place], pixels_[place + 1], pixels_[place + 2]};
  }
  void Set(int x, int y, const std::array<uint8_t, 3>& grey) {
    std::ranges::copy(grey, &pixels_[static_cast<size_t>((y * kSize + x) * 3)]);
  }
  ImageView View() const { return {pixels_.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8}; }
  Blob blob_;

 private:
  std::vector<uint8_t> pixels_;
};

double Flat(int, int) { return 10; }

TEST(MarkerMeter, FindsTheCentreOfADiscAnywhereInItsPixel) {
  MarkerMeter meter;
  for (const double radius : {3.3, 8.0, 13.0}) {
    for (double shift = 0; shift < 1; shift += 0.17) {
      const Eigen::Vector2d true_px(31 + shift, 33 - 0.6 * shift);
      const DiscImage image(true_px, radius, 1, Flat);
      MarkerCentre centre;
      ASSERT_TRUE(meter.Measure(image.View(), image.blob_, &centre));
      EXPECT_LT((centre.centre_px - true_px).norm(), 0.03) << radius << " " << shift;
      EXPECT_NEAR(centre.radius_px, radius, 0.3);
      EXPECT_LT(centre.skewness, 0.01);
    }
  }
}

TEST(MarkerMeter, SaturationAndASlopingBackgroundMoveNothing) {
  MarkerMeter meter;
  const Eigen::Vector2d true_px(31.3, 32.8);
  const DiscImage saturated(true_px, 8, 2.2, Flat);
  const DiscImage sloping(true_px, 8, 1, [](int x, int) { return 10.0 + x; });
  for (const DiscImage* image : {&saturated, &sloping}) {
    MarkerCentre centre;
    ASSERT_TRUE(meter.Measure(image->View(), image->blob_, &centre));
    EXPECT_LT((centre.centre_px - true_px).norm(), 0.04);
  }
}

// A disc that is brighter on one side.
std::vector<uint8_t> UnevenDisc(const Eigen::Vector2d& centre, const Eigen::Vector3d& colour) {
  std::vector<uint8_t> pixels(kSize * kSize * 3);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - centre;
      const double share = 0.5 * std::erfc((d.norm() - 8) / (0.7 * std::sqrt(2.0)));
      const double light = 1 + 0.4 * d.x() / std::max(8.0, d.norm());
      for (int k = 0; k < 3; ++k) {
        pixels[static_cast<size_t>((y * kSize + x) * 3 + k)] = static_cast<uint8_t>(
            std::lround(std::min(255.0, share * light * colour[k] + (1 - share) * 10)));
      }
    }
  }
  return pixels;
}

// Where red is saturated, it does not show that one side is brighter, and seems to reach further.
TEST(MarkerMeter, SaturatedChannelOfAnUnevenDiscIsLeftOut) {
  const Eigen::Vector2d true_px(31.3, 32.8);
  const DiscImage plain(true_px, 8, 1, Flat);
  const std::array<bool, 3> only_red = {false, false, true}, all_but_blue = {false, true, true};
  // Where green is, too, blue says it with a tenth of the grey levels.
  for (const bool both : {false, true}) {
    const Eigen::Vector3d colour =
        both ? Eigen::Vector3d(45, 700, 1500) : Eigen::Vector3d(40, 95, 230);
    const std::vector<uint8_t> pixels = UnevenDisc(true_px, colour);
    const ImageView image{pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8};
    MarkerMeter meter;
    MarkerCentre centre;
    ASSERT_TRUE(meter.Measure(image, plain.blob_, &centre));
    EXPECT_EQ(centre.saturated, both ? all_but_blue : only_red);
    OutlinePixels outline;
    meter.CollectPixels(image, centre, &outline);
    EXPECT_FALSE(outline.clipped);
    float most = 0;
    for (const float coverage : outline.coverage) most = std::max(most, coverage);
    // With the saturated channels 1.1.
    EXPECT_GT(most, 1.25f);
  }
}

TEST(MarkerMeter, ClippedLightIsSaidToBeSo) {
  const Eigen::Vector2d true_px(31.3, 32.8);
  const DiscImage plain(true_px, 8, 1, Flat);
  const std::vector<uint8_t> pixels = UnevenDisc(true_px, {14, 700, 1500});
  const ImageView image{pixels.data(), kSize, kSize, kSize * 3, PixelFormat::kBgr8};
  MarkerMeter meter;
  MarkerCentre centre;
  ASSERT_TRUE(meter.Measure(image, plain.blob_, &centre));
  OutlinePixels outline;
  meter.CollectPixels(image, centre, &outline);
  EXPECT_TRUE(outline.clipped);
}

TEST(MarkerMeter, SaysWhatOfItsBackgroundIsSaturated) {
  MarkerMeter meter;
  const auto saturated = [&](const DiscImage& image) {
    MarkerCentre centre;
    EXPECT_TRUE(meter.Measure(image.View(), image.blob_, &centre));
    return centre.saturated_behind;
  };
  const Eigen::Vector2d at(31, 33);
  EXPECT_EQ(saturated(DiscImage(at, 8, 1, Flat)), 0);
  EXPECT_GT(saturated(DiscImage(at, 8, 1, [](int, int) { return 255.0; })), 0.99);
  const double half = saturated(DiscImage(at, 8, 1, [](int x, int) { return x < 31 ? 255. : 10; }));
  EXPECT_GT(half, 0.4);
  EXPECT_LT(half, 0.8);
}

TEST(MarkerMeter, AnotherDiscBesideItMovesLittle) {
  MarkerMeter meter;
  const Eigen::Vector2d true_px(28.2, 32.6);
  const DiscImage image(
      true_px, 6, 1, [](int x, int y) { return std::hypot(x - 42, y - 32.6) < 6 ? 175.0 : 10.0; });
  MarkerCentre centre;
  ASSERT_TRUE(meter.Measure(image.View(), image.blob_, &centre));
  EXPECT_LT((centre.centre_px - true_px).norm(), 0.2)
      << "1.8 px of gap, less than the blur of both";
}

TEST(MarkerMeter, AHalfCoveredDiscIsLopsided) {
  MarkerMeter meter;
  DiscImage image({32, 32}, 8, 1, Flat);
  std::vector<uint8_t> pixels(image.View().data, image.View().data + kSize * kSize * 3);
  for (int y = 0; y < kSize; ++y) {
    std::fill_n(pixels.begin() + (y * kSize + 33) * 3, 3 * 20, uint8_t{10});
  }
  ImageView view = image.View();
  view.data = pixels.data();
  Blob half = image.blob_;
  half.centre_px.x() -= 3;
  MarkerCentre centre;
  ASSERT_TRUE(meter.Measure(view, half, &centre));
  EXPECT_GT(centre.skewness, 0.03);
}

TEST(MarkerMeter, NothingToMeasure) {
  MarkerMeter meter;
  const DiscImage flat({32, 32}, 8, 0.06, Flat);
  MarkerCentre centre;
  EXPECT_FALSE(meter.Measure(flat.View(), flat.blob_, &centre));
  const DiscImage corner({1, 1}, 8, 1, Flat);
  if (meter.Measure(corner.View(), corner.blob_, &centre)) {
    EXPECT_TRUE(centre.cut);
  }
}

}  // namespace
}  // namespace rigcal::agent::marker_centre_test
