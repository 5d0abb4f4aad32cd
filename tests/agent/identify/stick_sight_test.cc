// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/stick_sight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace rigcal::agent::stick_sight_test {
namespace {

constexpr int kWidth = 120, kHeight = 80;

// A wall; a stick of 3 px along row 40 from x = 20 to 90.
class Room {
 public:
  Room(int wall_grey, int stick_grey) : pixels_(size_t{3} * kWidth * kHeight) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, 2);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool is_stick = x >= 20 && x < 90 && y >= 39 && y <= 41;
        Set(x, y, (is_stick ? stick_grey : wall_grey) + noise(random));
      }
    }
  }

  void Cover(int from_x, int to_x, int grey) {
    for (int y = 20; y < 60; ++y) {
      for (int x = from_x; x < to_x; ++x) Set(x, y, grey);
    }
  }

  double Share(double from_x, double to_x, double y = 40) const {
    const ImageView view{pixels_.data(), kWidth, kHeight, ptrdiff_t{3} * kWidth,
                         PixelFormat::kBgr8};
    return StickShare(view, {from_x, y}, {to_x, y}, 5);
  }

 private:
  void Set(int x, int y, double grey) {
    const auto value = static_cast<uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    std::fill_n(&pixels_[3 * (static_cast<size_t>(y) * kWidth + static_cast<size_t>(x))], 3, value);
  }

  std::vector<uint8_t> pixels_;
};

TEST(StickShare, SeesBrightAndDarkSticks) {
  EXPECT_GT(Room(60, 90).Share(25, 85), 0.9);
  EXPECT_GT(Room(60, 40).Share(25, 85), 0.9);
}

TEST(StickShare, SeesNoneOnAWall) {
  EXPECT_LT(Room(60, 60).Share(25, 85), 0.3);
  EXPECT_LT(Room(60, 90).Share(25, 85, 55), 0.3);
}

TEST(StickShare, SeesOneBeforeThingsOfDifferentBrightness) {
  Room room(60, 90);
  room.Cover(50, 70, 120);
  Room half(60, 60);
  half.Cover(50, 70, 120);
  EXPECT_LT(half.Share(25, 85), 0.5);
  // The stick before both.
  EXPECT_LT(room.Share(52, 68), 0.3);
  EXPECT_GT(room.Share(25, 49), 0.9);
}

TEST(StickShare, WhatIsTooShortOrOutsideTellsNothing) {
  const Room room(60, 90);
  EXPECT_EQ(room.Share(40, 43), 0);
  EXPECT_EQ(room.Share(25, 85, -20), 0);
}

}  // namespace
}  // namespace rigcal::agent::stick_sight_test
