// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

namespace rigcal::agent::partial_wands_test {
namespace {

constexpr int kWidth = 640, kHeight = 480;
constexpr double kRadius = 10;  // of a sphere of 40 mm at 2 m

CameraDescription Camera() {
  CameraDescription camera;
  camera.camera = "test";
  camera.image_size_px = {kWidth, kHeight};
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 1000;
  intrinsics.cx_px = 320;
  intrinsics.cy_px = 240;
  camera.intrinsics = intrinsics;
  return camera;
}

Target PaperWand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  target.diameter_m = 0.04;
  return target;
}

// Orange discs in the dark.
class Discs {
 public:
  Discs() : pixels_(size_t{3} * kWidth * kHeight, 12) {}

  void Add(double x, double y) {
    Draw(x, y, kRadius);
    Blob blob;
    blob.centre_px = {x, y};
    blob.second_moment_px2 = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
    blob.area_px = static_cast<int>(std::numbers::pi * kRadius * kRadius);
    wholes_.push_back({blob, {kGrey[0], kGrey[1], kGrey[2]}});
  }

  // Of a disc what is right of its middle.
  void AddHalf(double x, double y) { Draw(x, y, kRadius, x); }

  PartialWands Search(double work) const {
    const ImageView view{pixels_.data(), kWidth, kHeight, ptrdiff_t{3} * kWidth,
                         PixelFormat::kBgr8};
    return FindPartialWands(view, WandFinder({}, PaperWand(), Camera()), wholes_, {}, 100, &work);
  }

 private:
  static constexpr std::array<uint8_t, 3> kGrey = {40, 110, 200};

  void Draw(double x, double y, double radius, double from_x = 0) {
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        if (u < from_x || (u - x) * (u - x) + (v - y) * (v - y) > radius * radius) continue;
        std::copy(kGrey.begin(), kGrey.end(),
                  &pixels_[3 * (static_cast<size_t>(v) * kWidth + static_cast<size_t>(u))]);
      }
    }
  }

  std::vector<uint8_t> pixels_;
  std::vector<WholeMarker> wholes_;
};

TEST(FindPartialWands, FindsAWandOfWhichHalfOfASphereIsSeen) {
  Discs discs;
  discs.Add(200, 240);
  discs.AddHalf(265, 240);
  discs.Add(395, 240);
  const PartialWands found = discs.Search(3000);
  ASSERT_FALSE(found.candidates.empty());
  EXPECT_EQ(found.candidates[0].partial, 1);
  EXPECT_EQ(found.candidates[0].blobs[0], 0);
  EXPECT_EQ(found.candidates[0].blobs[2], 1);
  EXPECT_FALSE(found.cut_short);
}

// In a room with lamps and labels there are many pairs of things that are alike.
TEST(FindPartialWands, PlacesWhereNothingIsCostLittle) {
  Discs discs;
  for (int i = 0; i < 4; ++i) {
    discs.Add(130 + 61 * i, 90);
    discs.Add(150 + 58 * i, 400);
  }
  const PartialWands found = discs.Search(8000);
  EXPECT_GT(found.tried, 100);
}

}  // namespace
}  // namespace rigcal::agent::partial_wands_test
