// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace rigcal::event_noise_test {
namespace {

constexpr ImageSize kSize{64, 48};
constexpr double kPixels = 64 * 48;

EventRenderOptions Only(double background_hz, double leak_hz, double hot_pixels) {
  EventRenderOptions options;
  options.background_hz = background_hz;
  options.leak_hz = leak_hz;
  options.hot_pixels = hot_pixels;
  return options;
}

TEST(EventNoise, BackgroundIsPoissonInTimeAndEvenOverPixelsAndPolarities) {
  EventNoise noise(kSize, Only(40, 0, 0));
  std::vector<NoiseEvent> events;
  noise.Until(10e6, &events);
  const double expected = 40 * 10 * kPixels;  // 1.2 million
  EXPECT_NEAR(static_cast<double>(events.size()), expected, 5 * std::sqrt(expected));
  std::vector<double> by_pixel(static_cast<size_t>(kPixels));
  double on = 0, gaps = 0, squares = 0, last = 0;
  for (const NoiseEvent& event : events) {
    ASSERT_LT(event.pixel, by_pixel.size());
    ASSERT_GE(event.time_us, last);
    ASSERT_LT(event.time_us, 10e6);
    ++by_pixel[event.pixel];
    on += event.on ? 1 : 0;
    gaps += event.time_us - last;
    squares += (event.time_us - last) * (event.time_us - last);
    last = event.time_us;
  }
  const auto count = static_cast<double>(events.size());
  EXPECT_NEAR(on / count, 0.5, 5 * 0.5 / std::sqrt(count));
  // Exponential gaps: the mean of squares is twice the square of the mean.
  EXPECT_NEAR(squares / count / std::pow(gaps / count, 2), 2, 0.03);
  // Chi square of the pixels' counts over its degrees of freedom.
  double chi = 0;
  for (const double one : by_pixel) chi += std::pow(one - count / kPixels, 2) / (count / kPixels);
  EXPECT_NEAR(chi / (kPixels - 1), 1, 5 * std::sqrt(2 / kPixels));
}

TEST(EventNoise, LeakageIsBrighterAlways) {
  EventNoise noise(kSize, Only(0, 5, 0));
  std::vector<NoiseEvent> events;
  noise.Until(1e6, &events);
  EXPECT_NEAR(static_cast<double>(events.size()), 5 * kPixels, 5 * std::sqrt(5 * kPixels));
  for (const NoiseEvent& event : events) ASSERT_TRUE(event.on);
}

TEST(EventNoise, HotPixelsAreFewAndFast) {
  EventRenderOptions options = Only(0, 0, 7);
  options.hot_hz = 2000;
  EventNoise noise(kSize, options);
  std::vector<NoiseEvent> events;
  noise.Until(1e6, &events);
  std::map<uint32_t, int> by_pixel;
  for (const NoiseEvent& event : events) ++by_pixel[event.pixel];
  EXPECT_EQ(by_pixel.size(), 7u);
  for (const auto& [pixel, count] : by_pixel) EXPECT_NEAR(count, 2000, 5 * std::sqrt(2000));
}

TEST(EventNoise, SlicesGiveTheSameAsTheWhole) {
  const EventRenderOptions options = Only(20, 3, 5);
  EventNoise whole(kSize, options), sliced(kSize, options);
  std::vector<NoiseEvent> expected, events;
  whole.Until(1e5, &expected);
  for (int i = 1; i <= 100; ++i) sliced.Until(1e3 * i, &events);
  ASSERT_EQ(events.size(), expected.size());
  for (size_t i = 0; i < events.size(); ++i) {
    ASSERT_EQ(events[i].time_us, expected[i].time_us);
    ASSERT_EQ(events[i].pixel, expected[i].pixel);
    ASSERT_EQ(events[i].on, expected[i].on);
  }
}

TEST(EventNoise, NoneIsNone) {
  EventNoise noise(kSize, Only(0, 0, 0));
  std::vector<NoiseEvent> events;
  noise.Until(1e12, &events);
  EXPECT_TRUE(events.empty());
}

}  // namespace
}  // namespace rigcal::event_noise_test
