// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/alike_things.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace rigcal::agent::alike_things_test {
namespace {

constexpr int kWidth = 400, kHeight = 300;
constexpr double kRadiusPx = 5;

struct Colour {
  uint8_t b, g, r;
};
constexpr Colour kOrange = {40, 130, 220}, kBlue = {220, 130, 40};

// A wand of 80 px along row 150 about x = 200 in a dark room, and what is put beside it.
class Room {
 public:
  Room() : pixels_(size_t{3} * kWidth * kHeight, 30) {
    for (const double x : {160.0, 186.7, 240.0}) {
      Paint({x, 150}, kRadiusPx, kOrange);
      MarkerCentre centre;
      centre.centre_px = {x, 150};
      centre.radius_px = kRadiusPx;
      wand_.centres.push_back(centre);
      wand_.whole.push_back(true);
      wand_.blobs.push_back(static_cast<int>(blobs_.size() - 1));
    }
  }

  Room& With(double x, double y, double radius_px = kRadiusPx, const Colour& colour = kOrange) {
    Paint({x, y}, radius_px, colour);
    return *this;
  }

  AlikeThings Things() const {
    const ImageView view{pixels_.data(), kWidth, kHeight, ptrdiff_t{3} * kWidth,
                         PixelFormat::kBgr8};
    return ThingsLike(view, blobs_, wand_);
  }

 private:
  void Paint(const Eigen::Vector2d& at_px, double radius_px, const Colour& colour) {
    Blob blob;
    blob.centre_px = at_px;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if ((Eigen::Vector2d(x, y) - at_px).norm() > radius_px) continue;
        uint8_t* const pixel = &pixels_[static_cast<size_t>(3 * (y * kWidth + x))];
        pixel[0] = colour.b, pixel[1] = colour.g, pixel[2] = colour.r;
        ++blob.area_px;
      }
    }
    blobs_.push_back(blob);
  }

  std::vector<uint8_t> pixels_;
  std::vector<Blob> blobs_;
  VerifiedWand wand_;
};

TEST(AlikeThings, ItsOwnMarkersAreNone) {
  EXPECT_EQ(Room().Things().near_count, 0);
  EXPECT_FALSE(Room().Things().go_on_as_row);
}

TEST(AlikeThings, ThoseNearByAreCounted) {
  EXPECT_EQ(Room().With(200, 180).With(180, 100).With(260, 200).Things().near_count, 3);
  EXPECT_EQ(Room().With(200, 280).With(30, 150).Things().near_count, 0);  // 130 and 170 px away
}

TEST(AlikeThings, ThoseOfAnotherColourBrightnessOrSizeAreNotCounted) {
  EXPECT_EQ(Room().With(200, 180, kRadiusPx, kBlue).Things().near_count, 0);
  EXPECT_EQ(Room().With(200, 180, kRadiusPx, {20, 65, 110}).Things().near_count, 0);
  EXPECT_EQ(Room().With(200, 180, 2).Things().near_count, 0);
  EXPECT_EQ(Room().With(200, 180, 10).Things().near_count, 0);
}

TEST(AlikeThings, OneOnTheLineGoesOnAsARow) {
  EXPECT_TRUE(Room().With(290, 151).Things().go_on_as_row);
  EXPECT_TRUE(Room().With(213, 150).Things().go_on_as_row);
  EXPECT_FALSE(Room().With(290, 160).Things().go_on_as_row);  // beside the line
  EXPECT_FALSE(Room().With(320, 150).Things().go_on_as_row);  // further than a span beyond
  EXPECT_FALSE(Room().With(290, 151, kRadiusPx, kBlue).Things().go_on_as_row);
}

TEST(AlikeThings, HiddenMarkersSayNothing) {
  VerifiedWand wand;
  wand.centres.resize(3);
  wand.whole.assign(3, false);
  const std::vector<uint8_t> pixels(size_t{3} * kWidth * kHeight, 30);
  const ImageView view{pixels.data(), kWidth, kHeight, ptrdiff_t{3} * kWidth, PixelFormat::kBgr8};
  const AlikeThings things = ThingsLike(view, std::vector<Blob>(2), wand);
  EXPECT_EQ(things.near_count, 0);
  EXPECT_FALSE(things.go_on_as_row);
}

}  // namespace
}  // namespace rigcal::agent::alike_things_test
