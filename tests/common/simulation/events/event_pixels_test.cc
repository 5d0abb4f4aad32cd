// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_pixels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/simulation/events/event_noise.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal::event_pixels_test {
namespace {

constexpr ImageSize kSize{200, 100};
constexpr float kLed = 5;  // ln(light) of full speed
constexpr double kStretchUs = 1000;

EventRenderOptions Even() {
  EventRenderOptions options;
  options.threshold_spread = options.threshold_jitter = options.refractory_spread = 0;
  options.refractory_us = 100;
  return options;
}

// Every pixel goes from darkness `from` to `to` at once and stays there for a stretch.
std::vector<PixelRequest> StepAll(EventPixels* pixels, float from, float to) {
  std::vector<PixelRequest> requests;
  const std::vector<float> light(kSize.width, to);
  for (uint32_t y = 0; y < kSize.height; ++y) {
    for (uint32_t x = 0; x < kSize.width; ++x) pixels->Settle(x, y, from);
    pixels->Add(0, y, light, light);
  }
  pixels->FollowAdded(0, kStretchUs, &requests);
  return requests;
}

TEST(EventPixels, LowPassDelaysTheCrossing) {
  EventRenderOptions options = Even();
  options.latency_us = 80;
  options.latency_slowdown = 0;
  EventPixels pixels(kSize, options, kLed);
  const auto requests = StepAll(&pixels, kLed - 1, kLed);
  // 0.25 of a step of 1 is passed at tau ln(1 / 0.75), the end of the reset is at 123 us.
  ASSERT_FALSE(requests.empty());
  EXPECT_NEAR(requests.front().time_us, 80 * std::log(1 / 0.75), 0.5);
  EXPECT_TRUE(requests.front().on);
  EXPECT_EQ(requests.size(), kSize.width * kSize.height);
}

TEST(EventPixels, DarknessSlowsIt) {
  EventRenderOptions options = Even();
  options.latency_us = 80;
  options.latency_slowdown = 0.1;
  EventPixels pixels(kSize, options, kLed);
  const auto requests = StepAll(&pixels, kLed - 1, kLed - 2);
  ASSERT_FALSE(requests.empty());
  const double tau = 80 * (1 + 0.1 * (std::exp(2) - 1));
  EXPECT_NEAR(requests.front().time_us, tau * std::log(1 / 0.75), 0.5);
  EXPECT_FALSE(requests.front().on);
}

TEST(EventPixels, ThresholdsSpreadOverPixels) {
  EventRenderOptions options = Even();
  options.threshold_spread = 0.2;
  options.refractory_us = 1e5;
  options.latency_us = 100;
  options.latency_slowdown = 0;
  EventPixels pixels(kSize, options, kLed);
  const auto requests = StepAll(&pixels, kLed - 1, kLed);
  ASSERT_EQ(requests.size(), kSize.width * kSize.height);
  double sum = 0, squares = 0;
  for (const PixelRequest& request : requests) {
    const double threshold = 1 - std::exp(-request.time_us / 100);
    sum += threshold;
    squares += threshold * threshold;
  }
  const auto count = static_cast<double>(requests.size());
  const double mean = sum / count;
  EXPECT_NEAR(mean, 0.25, 0.002);
  EXPECT_NEAR(std::sqrt(squares / count - mean * mean), 0.05, 0.002);
}

TEST(EventPixels, ThresholdsJitterFromEventToEvent) {
  EventRenderOptions options = Even();
  options.threshold_jitter = 0.1;
  options.refractory_us = 0;
  options.latency_us = 0;
  EventPixels pixels(kSize, options, kLed);
  pixels.Settle(3, 4, 0);
  std::vector<PixelRequest> requests;
  // A long ramp: its crossings are one threshold apart.
  for (int i = 0; i < 2000; ++i) {
    const float from = static_cast<float>(i) / 2, to = static_cast<float>(i + 1) / 2;
    pixels.Add(3, 4, {&from, 1}, {&to, 1});
    pixels.FollowAdded(i * kStretchUs, kStretchUs, &requests);
  }
  ASSERT_NEAR(static_cast<double>(requests.size()), 4000, 30);
  double squares = 0;
  for (size_t i = 1; i < requests.size(); ++i) {
    const double step = 0.5e-3 * (requests[i].time_us - requests[i - 1].time_us);
    squares += (step - 0.25) * (step - 0.25);
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(requests.size())), 0.025, 0.002);
}

TEST(EventPixels, NoiseIsHeldInResetToo) {
  EventRenderOptions options = Even();
  options.refractory_us = 300;
  EventPixels pixels(kSize, options, kLed);
  std::vector<PixelRequest> requests;
  const std::vector<NoiseEvent> noise = {
      {0, 1, true}, {299, 1, true}, {301, 1, false}, {302, 201, true}};
  pixels.Fire(noise, &requests);
  ASSERT_EQ(requests.size(), 3u);
  EXPECT_EQ(requests[1].time_us, 301);
  EXPECT_FALSE(requests[1].on);
  EXPECT_EQ(requests[2].x, 1);
  EXPECT_EQ(requests[2].y, 1);
}

// One pixel, worked out in steps of 0.02 us.
class PlainPixel {
 public:
  PlainPixel(const EventRenderOptions& options, float light)
      : options_(options), level_(light), reference_(light) {}
  void Follow(double from, double to, double begin_us, double duration_us,
              std::vector<PixelRequest>* requests) {
    constexpr double kStepUs = 0.02;
    const double tau = LowPassSpeed{static_cast<float>(options_.latency_us),
                                    static_cast<float>(options_.latency_slowdown), kLed}
                           .TauUs(static_cast<float>(to));
    const double decay = 1 - std::exp(-kStepUs / tau);
    const int steps = static_cast<int>(std::lround(duration_us / kStepUs));
    for (int i = 0; i < steps; ++i) {
      level_ += (from + (to - from) * (i + 0.5) / steps - level_) * decay;
      const double now_us = begin_us + (i + 1) * kStepUs;
      if (now_us < ready_us_) {
        reference_ = level_;
        continue;
      }
      const double moved = level_ - reference_;
      if (moved < options_.on_threshold && moved > -options_.off_threshold) continue;
      const bool on = moved > 0;
      requests->push_back({now_us, 0, 0, on});
      reference_ += on ? options_.on_threshold : -options_.off_threshold;
      ready_us_ = now_us + options_.refractory_us;
    }
  }

 private:
  EventRenderOptions options_;
  double level_, reference_, ready_us_ = 0;
};

TEST(EventPixels, FollowsABlinkingLightAsSmallStepsDo) {
  std::vector<double> errors_us;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    RandomStream draw{seed, 7};
    EventRenderOptions options = Even();
    options.refractory_us = draw.Uniform(50, 600);
    options.latency_us = draw.Uniform(10, 300);
    options.on_threshold = draw.Uniform(0.15, 0.5);
    options.off_threshold = draw.Uniform(0.15, 0.5);
    EventPixels pixels(kSize, options, kLed);
    auto light = static_cast<float>(draw.Uniform(2, 4));
    pixels.Settle(0, 0, light);
    PlainPixel plain(options, light);
    std::vector<PixelRequest> requests, expected;
    double now_us = 0;
    for (int i = 0; i < 40; ++i) {
      // Switches, then goes on slowly.
      const float from = i % 3 == 0 ? static_cast<float>(draw.Uniform(1, 6)) : light;
      light = from + static_cast<float>(draw.Uniform(-0.6, 0.6));
      const double duration_us = std::round(draw.Uniform(20, 700));
      pixels.Add(0, 0, {&from, 1}, {&light, 1});
      pixels.FollowAdded(now_us, duration_us, &requests);
      plain.Follow(from, light, now_us, duration_us, &expected);
      now_us += duration_us;
    }
    ASSERT_EQ(requests.size(), expected.size()) << "seed " << seed;
    EXPECT_GT(requests.size(), 10u);
    for (size_t i = 0; i < requests.size(); ++i) {
      EXPECT_EQ(requests[i].on, expected[i].on) << "seed " << seed;
      errors_us.push_back(std::abs(requests[i].time_us - expected[i].time_us));
    }
  }
  std::sort(errors_us.begin(), errors_us.end());
  // Where the level creeps, a small error of one event is a larger one of the next.
  EXPECT_LT(errors_us[errors_us.size() / 2], 0.1);
  EXPECT_LT(errors_us[errors_us.size() * 9 / 10], 0.5);
  EXPECT_LT(errors_us.back(), 25);
}

TEST(EventPixels, WithoutABeginningItGoesOnFromWhatItSawLast) {
  EventPixels explicit_pixels(kSize, Even(), kLed), pixels(kSize, Even(), kLed);
  std::vector<PixelRequest> expected, requests;
  std::vector<float> from(70, 0.0f), to(70);
  for (int i = 0; i < 30; ++i) {
    for (size_t k = 0; k < to.size(); ++k) {
      to[k] = std::sin(0.3f * static_cast<float>(i) + 0.1f * static_cast<float>(k));
    }
    if (i == 0) from = to;
    explicit_pixels.Add(5, 2, from, to);
    explicit_pixels.FollowAdded(i * kStretchUs, kStretchUs, &expected);
    pixels.Add(5, 2, i == 0 ? std::span<const float>(from) : std::span<const float>(), to);
    pixels.FollowAdded(i * kStretchUs, kStretchUs, &requests);
    from = to;
  }
  ASSERT_EQ(requests.size(), expected.size());
  EXPECT_GT(requests.size(), 300u);
  for (size_t i = 0; i < requests.size(); ++i) {
    ASSERT_EQ(requests[i].time_us, expected[i].time_us);
    ASSERT_EQ(requests[i].x, expected[i].x);
  }
}

// v2e: linear in the light, from all of it in the dark to a quarter at full light.
TEST(EventPixels, ShotNoiseFallsWithTheLight) {
  EventRenderOptions options = Even();
  options.background_hz = options.leak_hz = options.hot_pixels = 0;
  options.shot_hz = 40;
  options.refractory_us = 0;
  const double drawn = 40 * 2 * kSize.width * kSize.height;  // within 2 s
  for (const auto& [light, share] : {std::pair{kLed - 12, 1.0},
                                     {kLed + std::log(0.5f), 0.625},
                                     {kLed, 0.25},
                                     {kLed + 3, 0.25}}) {
    EventPixels pixels(kSize, options, kLed);
    for (uint32_t y = 0; y < kSize.height; ++y) {
      for (uint32_t x = 0; x < kSize.width; ++x) pixels.Settle(x, y, light);
    }
    EventNoise noise(kSize, options);
    std::vector<NoiseEvent> events;
    noise.Until(2e6, &events);
    EXPECT_NEAR(static_cast<double>(events.size()), drawn, 5 * std::sqrt(drawn));
    std::vector<PixelRequest> requests;
    pixels.Fire(events, &requests);
    const double expected = drawn * share;
    EXPECT_NEAR(static_cast<double>(requests.size()), expected, 5 * std::sqrt(expected)) << light;
    const auto on = std::count_if(requests.begin(), requests.end(),
                                  [](const PixelRequest& request) { return request.on; });
    EXPECT_NEAR(static_cast<double>(on), expected / 2, 5 * std::sqrt(expected)) << light;
  }
}

}  // namespace
}  // namespace rigcal::event_pixels_test
