// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "tests/testing/status_matchers.h"

namespace rigcal::event_renderer_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

constexpr ImageSize kSize{160, 120};

EventRenderOptions Quiet() {
  EventRenderOptions options;
  options.background_hz = options.leak_hz = options.hot_pixels = 0;
  options.bars = options.lamps = 0;
  return options;
}

absl::StatusOr<EventRenderer> MakeRenderer(const EventRenderOptions& options, double blink_hz) {
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 500;
  intrinsics.cx_px = 80;
  intrinsics.cy_px = 60;
  Target target;
  target.kind = TargetKind::kPoint;
  target.marker_positions_m = {0};
  target.diameter_m = 0.04;
  target.blink_hz = {blink_hz};
  return EventRenderer::Create(intrinsics, kSize, target, FrameRenderOptions(), options);
}

std::optional<WandPose> Standing(double) { return WandPose{{0.02, -0.01, 1}, {1, 0, 0}}; }

TEST(EventRenderer, DarkRoomWithoutNoiseIsSilent) {
  ASSERT_OK_AND_ASSIGN(EventRenderer renderer, MakeRenderer(Quiet(), 500));
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  ASSERT_THAT(renderer.Render(20000, nullptr, &events, &triggers), IsOk());
  EXPECT_TRUE(events.empty());
}

TEST(EventRenderer, BlinkingSphereChangesEveryPixelOnceEachWay) {
  EventRenderOptions options = Quiet();
  options.led_phase = 0.75;  // lit from 0.5 ms on
  ASSERT_OK_AND_ASSIGN(EventRenderer renderer, MakeRenderer(options, 500));
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  ASSERT_THAT(renderer.Render(20000, &Standing, &events, &triggers), IsOk());
  const MarkerGroundTruth truth = renderer.TruthOf(*Standing(0))[0];
  EXPECT_NEAR(truth.centre_px.x(), 90, 0.1);
  int on = 0, off = 0;
  for (const SimulatedEvent& event : events) {
    EXPECT_LT(std::hypot(event.x - truth.centre_px.x(), event.y - truth.centre_px.y()),
              truth.radius_px + 4);
    if (event.x != 90 || event.y != 55) continue;
    ++(event.on ? on : off);
    const int64_t phase_us = (event.time_us + 1500) % 2000;
    EXPECT_GE(phase_us, event.on ? 0 : 1000);
    EXPECT_LE(phase_us, event.on ? 200 : 1300);
  }
  EXPECT_EQ(on, 10);
  EXPECT_EQ(off, 10);
}

TEST(EventRenderer, HeldInResetItMissesTheLedGoingOut) {
  EventRenderOptions options = Quiet();
  options.refractory_us = 700;
  options.refractory_spread = 0;
  ASSERT_OK_AND_ASSIGN(EventRenderer renderer, MakeRenderer(options, 900));
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  ASSERT_THAT(renderer.Render(50000, &Standing, &events, &triggers), IsOk());
  int count = 0;
  for (const SimulatedEvent& event : events) count += event.x == 90 && event.y == 55;
  EXPECT_GE(count, 40);
  EXPECT_LE(count, 46);  // one for each of the 45 periods, not two
}

TEST(EventRenderer, SlicesAndRepetitionGiveTheSameEventsInOrderOfTime) {
  EventRenderOptions options;
  options.bar_px = 50;
  ASSERT_OK_AND_ASSIGN(EventRenderer whole, MakeRenderer(options, 500));
  ASSERT_OK_AND_ASSIGN(EventRenderer sliced, MakeRenderer(options, 500));
  std::vector<SimulatedEvent> expected, events;
  std::vector<SimulatedTrigger> expected_triggers, triggers;
  ASSERT_THAT(whole.Render(50000, &Standing, &expected, &expected_triggers), IsOk());
  for (int64_t end_us = 0; end_us <= 50000; end_us += 5000) {
    ASSERT_THAT(sliced.Render(end_us, &Standing, &events, &triggers), IsOk());
  }
  EXPECT_TRUE(events == expected);
  EXPECT_GT(events.size(), 1000u);
  EXPECT_TRUE(std::is_sorted(events.begin(), events.end(),
                             [](const auto& a, const auto& b) { return a.time_us < b.time_us; }));
  ASSERT_EQ(triggers.size(), 5u);
  ASSERT_EQ(expected_triggers.size(), 5u);
  for (size_t i = 0; i < triggers.size(); ++i) {
    EXPECT_EQ(triggers[i].time_us, static_cast<int64_t>(10000 * i));
    EXPECT_EQ(triggers[i].rising, i % 2 == 0);
  }
}

TEST(EventRenderer, NoiseHasItsRate) {
  EventRenderOptions options = Quiet();
  options.background_hz = 20;
  ASSERT_OK_AND_ASSIGN(EventRenderer renderer, MakeRenderer(options, 500));
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  ASSERT_THAT(renderer.Render(1000000, nullptr, &events, &triggers), IsOk());
  const double expected = 20.0 * kSize.width * kSize.height;  // 384 000, less 1 % held in reset
  EXPECT_NEAR(static_cast<double>(events.size()), 0.99 * expected, 0.02 * expected);
}

TEST(EventRenderer, RefusesBadTimesAndPoses) {
  ASSERT_OK_AND_ASSIGN(EventRenderer renderer, MakeRenderer(Quiet(), 500));
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  EXPECT_THAT(renderer.Render(100, nullptr, &events, &triggers),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("event renderer")));
  ASSERT_THAT(renderer.Render(2000, nullptr, &events, &triggers), IsOk());
  EXPECT_THAT(renderer.Render(1000, nullptr, &events, &triggers),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("event renderer")));
  const auto nowhere = [](double) -> std::optional<WandPose> {
    return WandPose{{std::nan(""), 0, 0}, {1, 0, 0}};
  };
  EXPECT_THAT(renderer.Render(3000, nowhere, &events, &triggers),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("event renderer")));
}

}  // namespace
}  // namespace rigcal::event_renderer_test
