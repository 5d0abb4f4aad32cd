// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_track.h"

#include <gtest/gtest.h>

namespace rigcal::agent::wand_track_test {
namespace {

constexpr PixelRect kBounds{0, 0, 1280, 1024};
constexpr int64_t kMs = 1'000'000;

bool Contains(const PixelRect& rect, double x, double y) {
  return x >= rect.x && y >= rect.y && x < rect.x + rect.width && y < rect.y + rect.height;
}

TEST(WandTrack, WindowMovesWithTheWand) {
  WandTrack track;
  EXPECT_FALSE(track.Window(0, 0, kBounds).has_value());
  track.Add(0, 0, {{300, 300}, {400, 300}}, 8);
  track.Add(20 * kMs, 0, {{340, 310}, {440, 310}}, 8);
  EXPECT_NEAR(track.Velocity(0)->x(), 2000, 1e-6);
  const auto window = track.Window(40 * kMs, 0, kBounds);
  ASSERT_TRUE(window.has_value());
  EXPECT_TRUE(Contains(*window, 380, 320));
  EXPECT_TRUE(Contains(*window, 480, 320));
  EXPECT_LT(window->width * window->height, 1280 * 1024 / 10);
}

TEST(WandTrack, ForgetsOnPausesStepsAndEpochs) {
  WandTrack track;
  track.Add(0, 0, {{300, 300}}, 8);
  EXPECT_TRUE(track.Window(20 * kMs, 0, kBounds).has_value());
  EXPECT_FALSE(track.Window(20 * kMs, 1, kBounds).has_value());
  EXPECT_FALSE(track.Window(-kMs, 0, kBounds).has_value());
  EXPECT_FALSE(track.Window(2000 * kMs, 0, kBounds).has_value());
  track.Add(2000 * kMs, 0, {{500, 300}}, 8);
  EXPECT_FALSE(track.Velocity(0).has_value());
  track.Forget();
  EXPECT_FALSE(track.Window(2020 * kMs, 0, kBounds).has_value());
}

TEST(WandTrack, WindowOutsideOfThePictureIsNone) {
  WandTrack track;
  track.Add(0, 0, {{1200, 300}}, 8);
  track.Add(20 * kMs, 0, {{1270, 300}}, 8);
  EXPECT_FALSE(track.Window(200 * kMs, 0, kBounds).has_value() &&
               track.Window(200 * kMs, 0, kBounds)->x > 1280);
}

}  // namespace
}  // namespace rigcal::agent::wand_track_test
