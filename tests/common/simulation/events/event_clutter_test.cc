// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_clutter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::event_clutter_test {
namespace {

constexpr ImageSize kSize{320, 200};

EventClutter MakeClutter(const EventRenderOptions& options, const EdgeProfile& profile) {
  return {kSize, options, std::vector<float>(kSize.width * kSize.height, 10.0f), 60, profile};
}

// What changes and is not within the spans changes too little for any threshold.
TEST(EventClutter, SpansHoldEveryPixelThatChanges) {
  const EdgeProfile profile(0.6, 0);
  EventRenderOptions options;
  options.bars = 6;
  options.bar_px = 100;
  options.bar_px_s = 400;
  options.bar_contrast = 1.5;
  const EventClutter clutter = MakeClutter(options, profile);
  EventClutter::Instant begin, end;
  std::vector<float> before(kSize.width), after(kSize.width);
  int changed = 0, followed = 0;
  for (int cell = 0; cell < 400; cell += 10) {
    clutter.InstantAt(1e-3 * cell, &begin);
    clutter.InstantAt(1e-3 * (cell + 1), &end);
    for (int y = 0; y < static_cast<int>(kSize.height); y += 3) {
      const PixelSpan row{0, static_cast<int>(kSize.width)};
      clutter.LightOf(y, row, begin, before.data());
      clutter.LightOf(y, row, end, after.data());
      std::vector<PixelSpan> spans;
      clutter.AddBarSpans(y, begin, end, &spans);
      clutter.AddLampSpans(y, &spans);
      MergeSpans(&spans);
      for (int x = 0; x < row.end; ++x) {
        const auto i = static_cast<size_t>(x);
        const double change = std::abs(std::log(after[i] / before[i]));
        bool inside = false;
        for (const PixelSpan& span : spans) inside |= x >= span.begin && x < span.end;
        followed += inside ? 1 : 0;
        changed += change > 2e-3 ? 1 : 0;
        ASSERT_TRUE(inside || change < 2e-3) << "row " << y << " column " << x << " cell " << cell;
      }
    }
  }
  EXPECT_GT(changed, 1000);
  EXPECT_LT(followed, 4 * changed);
}

TEST(EventClutter, LightOfAPartIsThatOfTheRow) {
  const EdgeProfile profile(0.6, 0);
  EventRenderOptions options;
  options.bars = 8;
  options.bar_px = 150;
  options.lamps = 6;
  options.lamp_radius_px = 30;
  const EventClutter clutter = MakeClutter(options, profile);
  EventClutter::Instant instant;
  clutter.InstantAt(0.123, &instant);
  std::vector<float> whole(kSize.width), part(kSize.width);
  for (int y = 0; y < static_cast<int>(kSize.height); y += 7) {
    clutter.LightOf(y, {0, static_cast<int>(kSize.width)}, instant, whole.data());
    for (int begin = 0; begin < 300; begin += 23) {
      clutter.LightOf(y, {begin, begin + 20}, instant, part.data());
      for (int x = 0; x < 20; ++x) {
        ASSERT_NEAR(part[static_cast<size_t>(x)] / whole[static_cast<size_t>(begin + x)], 1, 1e-5);
        ASSERT_GT(part[static_cast<size_t>(x)], 0);
      }
    }
  }
}

TEST(EventClutter, FastThingsAreCutIntoMoreParts) {
  const EdgeProfile profile(0.6, 0);
  EventRenderOptions options;
  EXPECT_EQ(MakeClutter(options, profile).BarParts(1e-3), 1);
  EXPECT_EQ(MakeClutter(options, profile).LampParts(1e-3), 2);  // 120 Hz
  options.bar_px_s = 3500;
  EXPECT_EQ(MakeClutter(options, profile).BarParts(1e-3), 10);
  EXPECT_EQ(MakeClutter(options, profile).LampParts(1e-3), 10);
  options.lamp_hz = 1e4;
  EXPECT_EQ(MakeClutter(options, profile).LampParts(1e-3), 40);
  options.bars = options.lamps = 0;
  EXPECT_EQ(MakeClutter(options, profile).LampParts(1e-3), 1);
}

}  // namespace
}  // namespace rigcal::event_clutter_test
