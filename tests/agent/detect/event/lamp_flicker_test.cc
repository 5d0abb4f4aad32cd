// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/lamp_flicker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/evt3_writer.h"
#include "common/simulation/events/event_renderer.h"

namespace rigcal::agent::lamp_flicker_test {
namespace {

constexpr SensorGeometry kSize{320, 240};

CameraDescription Camera() {
  CameraDescription camera;
  camera.camera = "left";
  camera.sensor = SensorKind::kEvent;
  camera.image_size_px = {kSize.width, kSize.height};
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 300;
  intrinsics.cx_px = 160;
  intrinsics.cy_px = 120;
  camera.intrinsics = intrinsics;
  return camera;
}

WandPose WandAt(double time_s) {
  return {{-0.2 + 0.15 * std::sin(5 * time_s), 0.05, 1.6},
          Eigen::Vector3d(1, 0.2, 0.3).normalized()};
}

struct View {
  uint32_t seed = 1;
  double lamps = 1;
  double lamp_hz = 100;
  int64_t clock_us = 0;  // what the camera's clock shows at time 0
  int seconds = 3;
};

// A wand that blinks at 500 Hz, bars that move, noise and lamps.
template <typename Sink>
void Render(const View& view, Sink sink) {
  EventRenderOptions options;
  options.seed = view.seed;
  options.lamps = view.lamps;
  options.lamp_hz = view.lamp_hz;
  const CameraDescription camera = Camera();
  auto renderer =
      EventRenderer::Create(*camera.intrinsics, camera.image_size_px,
                            *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"), {}, options);
  ASSERT_TRUE(renderer.ok()) << renderer.status();
  std::vector<SimulatedEvent> events;
  std::vector<SimulatedTrigger> triggers;
  // And a little more: a second ends with the first event behind it.
  for (int64_t end_us = 5000; end_us <= 1'000'000 * view.seconds + 10'000; end_us += 5000) {
    events.clear();
    ASSERT_TRUE(renderer->Render(end_us, WandAt, &events, &triggers).ok());
    sink(events, end_us);
  }
}

std::vector<LampReading> Read(const View& view) {
  LampFlicker flicker(kSize);
  flicker.Restart(view.clock_us);
  Render(view, [&](const std::vector<SimulatedEvent>& events, int64_t) {
    std::vector<PackedEvent> packed;
    for (const SimulatedEvent& event : events) {
      packed.push_back({static_cast<uint32_t>(event.time_us + view.clock_us),
                        static_cast<uint16_t>(event.x),
                        static_cast<uint16_t>(event.y | (event.on ? 0x8000 : 0))});
    }
    flicker.Take(packed);
  });
  return flicker.TakeReadings();
}

std::vector<LampReading> ReadOf(double hz, const View& view) {
  std::vector<LampReading> readings = Read(view);
  std::erase_if(readings, [&](const LampReading& reading) {
    return std::abs(1e6 / reading.period_us - hz) > 1;
  });
  return readings;
}

// How far `late` is behind `early` beyond whole thirds of a period, in (-1/6, 1/6] periods.
double BeyondThirdsUs(const LampReading& late, const LampReading& early) {
  const double third_us = (late.period_us + early.period_us) / 6;
  return std::remainder(static_cast<double>(late.time_us - early.time_us), third_us);
}

TEST(LampFlicker, ShowsHowClocksDiffer) {
  constexpr int64_t kApartUs = 3700;
  constexpr double kThirdUs = 1e4 / 3;
  // A clock whose lower 32 bits begin anew meanwhile, and lamps on all phases.
  const View one{.seed = 3, .lamps = 1, .clock_us = (int64_t{1} << 32) - 1'500'000};
  View other = one;
  other.seed = 8;
  other.lamps = 5;
  other.clock_us += kApartUs;
  const std::vector<LampReading> a = ReadOf(100, one), b = ReadOf(100, other);
  ASSERT_EQ(a.size(), 2u);
  ASSERT_EQ(b.size(), 2u);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i].period_us, 10'000, 3);
    EXPECT_NEAR(b[i].period_us, 10'000, 3);
    const double middle_us =
        static_cast<double>(one.clock_us) + 1e6 * (static_cast<double>(i) + 1.5);
    EXPECT_NEAR(static_cast<double>(a[i].time_us), middle_us, kThirdUs / 2 + 1);
    const double wrong_us =
        std::remainder(BeyondThirdsUs(b[i], a[i]) - static_cast<double>(kApartUs), kThirdUs);
    EXPECT_NEAR(wrong_us, 0, 100);
    EXPECT_LT(std::abs(wrong_us), 5 * std::hypot(a[i].sigma_us, b[i].sigma_us));
    EXPECT_LT(b[i].sigma_us, 100);
  }
}

// One lamp of each frequency.
TEST(LampFlicker, ReadsBothFrequencies) {
  const View view{.seed = 5, .lamps = 2};
  EXPECT_EQ(ReadOf(100, view).size(), 2u);
  EXPECT_EQ(ReadOf(120, view).size(), 2u);
}

// The mains are off by 0.2 %.
TEST(LampFlicker, FollowsTheMains) {
  for (const double hz : {100.2, 119.76}) {
    const std::vector<LampReading> readings = Read({.lamps = 1, .lamp_hz = hz, .seconds = 4});
    ASSERT_EQ(readings.size(), 3u) << hz;
    for (const LampReading& reading : readings) EXPECT_NEAR(reading.period_us, 1e6 / hz, 3);
    for (size_t i = 1; i < readings.size(); ++i) {
      EXPECT_NEAR(BeyondThirdsUs(readings[i], readings[i - 1]), 0, 100);
    }
  }
}

TEST(LampFlicker, SaysNothingWithoutLamps) {
  for (uint32_t seed = 1; seed <= 3; ++seed) EXPECT_TRUE(Read({.seed = seed, .lamps = 0}).empty());
}

TEST(LampFlicker, SaysNothingOfOtherLights) {
  for (const double hz : {90.0, 107.0, 113.0, 150.0}) {
    EXPECT_TRUE(Read({.lamps = 1, .lamp_hz = hz}).empty()) << hz;
  }
}

// Events of one pixel, ON where the light of a lamp rises and OFF where it falls.
std::vector<PackedEvent> Pixel(double hz, double phase_s, int64_t from_us, int64_t to_us) {
  std::vector<PackedEvent> events;
  for (int64_t time_us = from_us; time_us < to_us; time_us += 50) {
    const double turn = 2 * std::numbers::pi * hz * (1e-6 * static_cast<double>(time_us) - phase_s);
    if (std::abs(std::cos(turn)) < 0.8) continue;
    events.push_back({static_cast<uint32_t>(time_us), 5,
                      static_cast<uint16_t>(7 | (std::cos(turn) > 0 ? 0x8000 : 0))});
  }
  return events;
}

TEST(LampFlicker, ReadsWhenLightRisesFastest) {
  for (const size_t batch : {size_t{1}, size_t{100}, size_t{1000}}) {
    LampFlicker flicker(kSize);
    flicker.Restart(0);
    const std::vector<PackedEvent> events = Pixel(120, 0.0012, 0, 3'001'000);
    for (size_t at = 0; at < events.size(); at += batch) {
      flicker.Take(std::span(events).subspan(at, std::min(batch, events.size() - at)));
    }
    const std::vector<LampReading> readings = flicker.TakeReadings();
    ASSERT_EQ(readings.size(), 2u) << batch;
    for (const LampReading& reading : readings) {
      EXPECT_NEAR(reading.period_us, 1e6 / 120, 0.5);
      const double wrong_us =
          std::remainder(static_cast<double>(reading.time_us) - 1200, 1e6 / 360);
      EXPECT_NEAR(wrong_us, 0, 30);
    }
    EXPECT_TRUE(flicker.TakeReadings().empty());
  }
}

// A second with a hole is none; it is counted from the end of the hole on.
TEST(LampFlicker, BeginsAnewBehindALongHole) {
  LampFlicker flicker(kSize);
  flicker.Restart(0);
  flicker.Take(Pixel(100, 0.001, 0, 1'600'000));
  flicker.Take(Pixel(100, 0.001, 9'300'000, 11'100'000));
  EXPECT_TRUE(flicker.TakeReadings().empty());  // one whole second each, with none before
  flicker.Take(Pixel(100, 0.001, 11'100'000, 11'400'000));
  const std::vector<LampReading> readings = flicker.TakeReadings();
  ASSERT_EQ(readings.size(), 1u);
  EXPECT_NEAR(static_cast<double>(readings[0].time_us), 10'800'000, 2000);
  EXPECT_NEAR(std::remainder(static_cast<double>(readings[0].time_us) - 1000, 1e4 / 3), 0, 30);
}

// Whatever comes: pixels that no sensor has, times in any order.
TEST(LampFlicker, StandsEvents) {
  std::mt19937 random(5);
  LampFlicker flicker({1, 1});
  for (int i = 0; i < 20'000; ++i) {
    const PackedEvent event{static_cast<uint32_t>(random()), static_cast<uint16_t>(random()),
                            static_cast<uint16_t>(random())};
    flicker.Take({&event, 1});
  }
  for (const LampReading& reading : flicker.TakeReadings()) {
    EXPECT_TRUE(std::isfinite(reading.period_us));
    EXPECT_GT(reading.sigma_us, 0);
  }
}

TEST(LampFlicker, IsReadByTheDetectorOfWands) {
  auto detector =
      BlinkWandDetector::Create({}, *ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500"), Camera(),
                                EventFormat::kEvt3, /*halves_swapped=*/false);
  ASSERT_TRUE(detector.ok()) << detector.status();
  Evt3Writer writer;
  std::vector<Detection> found;
  std::vector<LampReading> readings;
  Render({.lamps = 1}, [&](const std::vector<SimulatedEvent>& events, int64_t end_us) {
    std::vector<CdEvent> cd_events;
    for (const SimulatedEvent& event : events) {
      cd_events.push_back({event.time_us, event.x, event.y, event.on});
    }
    std::vector<uint8_t> bytes;
    writer.Write(cd_events, &bytes);
    writer.WriteTime(end_us, &bytes);
    detector->Take(bytes, &found);
    for (const LampReading& reading : detector->TakeLampReadings()) readings.push_back(reading);
  });
  ASSERT_FALSE(readings.empty());
  const std::vector<LampReading> expected = Read({.lamps = 1});
  for (const LampReading& reading : readings) {
    EXPECT_NEAR(BeyondThirdsUs(reading, expected.at(0)), 0, 100);
  }
}

}  // namespace
}  // namespace rigcal::agent::lamp_flicker_test
