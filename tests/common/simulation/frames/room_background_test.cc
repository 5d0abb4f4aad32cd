// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/room_background.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/simulation/frames/room_painter.h"
#include "common/simulation/frames/sensor_noise.h"

namespace rigcal::room_background_test {
namespace {

const ImageSize kSize{640, 512};

std::vector<int16_t> Room(const FrameRenderOptions& options) {
  return RenderRoom(kSize, options, LightModel(options), EdgeProfile(0.6, 0));
}

double MeanGrey(const std::vector<int16_t>& room) {
  double sum = 0;
  for (const int16_t value : room) sum += value;
  return sum / kLinearPerGrey / static_cast<double>(room.size());
}

// Pixels that a detector of warm colours might take.
int WarmBrightPixels(const std::vector<int16_t>& room) {
  int count = 0;
  for (size_t i = 0; i < room.size(); i += 3) {
    if (room[i + 2] > 60 * kLinearPerGrey && room[i] < 0.65 * room[i + 2]) ++count;
  }
  return count;
}

TEST(RoomBackground, PlainWallHasTheLightOfItsReflectance) {
  FrameRenderOptions options;
  options.lux = 1000;
  options.vignetting = 0;
  const LightModel light(options);
  // 0.2 * 1000 / pi = 63.7 cd/m^2, where 400 make 180 grey.
  EXPECT_NEAR(MeanGrey(Room(options)), 6 + 28.6, 4);
  EXPECT_NEAR(light.shell_grey, 71.6, 0.1);
  options.lux = 0;
  for (const int16_t value : Room(options)) ASSERT_EQ(value, ToLinear(6));
}

TEST(RoomBackground, ClutterIsWarmAndGrowsAndFollowsFromTheSeed) {
  FrameRenderOptions options;
  options.lux = 500;
  const auto plain = Room(options);
  EXPECT_EQ(WarmBrightPixels(plain), 0);
  options.clutter = 0.5;
  int moderate = 0, much = 0;
  for (uint32_t seed = 1; seed <= 8; ++seed) {
    options.seed = seed;
    options.clutter = 0.5;
    moderate += WarmBrightPixels(Room(options));
    options.clutter = 2;
    much += WarmBrightPixels(Room(options));
  }
  EXPECT_GT(moderate, 500);
  EXPECT_GT(much, moderate);
  const auto once = Room(options);
  EXPECT_EQ(Room(options), once);
  options.seed = 99;
  EXPECT_NE(Room(options), once);
}

TEST(RoomBackground, CornersAreDarker) {
  EXPECT_EQ(VignettingAt(kSize, 0.3, 320, 256), 1);
  EXPECT_NEAR(VignettingAt(kSize, 0.3, 0, 0), 0.7, 1e-9);
}

TEST(LightModel, ColoursHaveTheirHue) {
  EXPECT_EQ(HueColour(0, 1), (Bgr{0, 0, 1}));
  EXPECT_EQ(HueColour(120, 1), (Bgr{0, 1, 0}));
  EXPECT_EQ(HueColour(240, 1), (Bgr{1, 0, 0}));
  const Bgr orange = HueColour(30, 0.8);
  EXPECT_NEAR(orange[2], 1, 1e-12);
  EXPECT_NEAR(orange[1], 0.6, 1e-12);
  EXPECT_NEAR(orange[0], 0.2, 1e-12);
}

TEST(LightModel, AutoGainKeepsSpheresBelowSaturation) {
  FrameRenderOptions options;
  options.auto_gain = true;
  for (const double lux : {0.0, 500.0, 5000.0, 50000.0}) {
    options.lux = lux;
    const LightModel light(options);
    EXPECT_LE(options.black_grey + 0.5 * light.led_grey[2] + light.shell_grey, 200.001);
  }
}

double BrightShare(const std::vector<int16_t>& room) {
  size_t bright = 0;
  for (size_t i = 0; i < room.size(); i += 3) bright += room[i + 1] > 255 * kLinearPerGrey ? 1 : 0;
  return 3.0 * static_cast<double>(bright) / static_cast<double>(room.size());
}

TEST(RoomBackground, WindowsAreOverexposedAndFollowFromTheSeed) {
  FrameRenderOptions options;
  options.lux = 400;
  options.led_cd_m2 = 300;
  EXPECT_EQ(BrightShare(Room(options)), 0);
  options.windows = 2;
  double share = 0;
  for (uint32_t seed = 1; seed <= 6; ++seed) {
    options.seed = seed;
    share += BrightShare(Room(options)) / 6;
    EXPECT_EQ(Room(options), Room(options));
  }
  EXPECT_GT(share, 0.03);
  EXPECT_LT(share, 0.6);
}

TEST(RoomBackground, ShelvesAndPeopleAreWarmAndNotBright) {
  for (double FrameRenderOptions::*kind :
       {&FrameRenderOptions::shelves, &FrameRenderOptions::people}) {
    FrameRenderOptions options;
    options.lux = 1000;
    options.led_cd_m2 = 300;
    options.*kind = 3;
    int warm = 0;
    for (uint32_t seed = 1; seed <= 6; ++seed) {
      options.seed = seed;
      warm += WarmBrightPixels(Room(options));
      EXPECT_LT(BrightShare(Room(options)), 0.2);
    }
    EXPECT_GT(warm, 500);
  }
}

TEST(RoomBackground, PhotographTakesThePlaceOfTheWall) {
  FrameRenderOptions options;
  options.lux = 1000;
  options.vignetting = 0;
  const std::vector<float> half(size_t{3} * kSize.width * kSize.height, 0.5f);
  const auto room = RenderRoom(kSize, options, LightModel(options), EdgeProfile(0.6, 0), &half);
  // 1000 / pi / 2 cd/m^2, where 400 make 180 grey.
  for (const int16_t value : room) {
    ASSERT_NEAR(static_cast<double>(value) / kLinearPerGrey, 6 + 71.6, 0.1);
  }
}

}  // namespace
}  // namespace rigcal::room_background_test
