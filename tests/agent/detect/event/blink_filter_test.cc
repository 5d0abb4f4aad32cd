// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::blink_filter_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kPeriodUs = 2000;

struct Event {
  uint32_t time_us, x, y;
  bool on;
};

// Discs that shine for the first half of each period, and what pixels see of them.
class Scene {
 public:
  double speed_px_s = 0;
  double radius_px = 12;
  double hz = 500;
  double noise_per_s = 0;
  uint32_t refractory_us = 0;  // in which a pixel emits no event
  uint32_t duration_us = 40'000;
  Eigen::Vector2d start_px{100.3, 80.6};

  Eigen::Vector2d CentreAt(double time_us) const {
    return start_px + Eigen::Vector2d(speed_px_s * 1e-6 * time_us, 0);
  }

  std::vector<Event> Events() const {
    std::vector<Event> events;
    std::vector<bool> bright(kWidth * kHeight, false);
    std::vector<uint32_t> ready_us(kWidth * kHeight, 0);
    std::mt19937 random(5);
    for (uint32_t t = 0; t < duration_us; t += 50) {
      const double phase = static_cast<double>(t) * hz / 1e6;
      const bool lit = phase - std::floor(phase) < 0.5;
      const Eigen::Vector2d centre = CentreAt(t);
      for (uint32_t y = 0; y < kHeight; ++y) {
        for (uint32_t x = 0; x < kWidth; ++x) {
          const bool now =
              lit && (Eigen::Vector2d(x, y) - centre).squaredNorm() < radius_px * radius_px;
          if (now == bright[y * kWidth + x]) continue;
          bright[y * kWidth + x] = now;
          if (t < ready_us[y * kWidth + x]) continue;
          ready_us[y * kWidth + x] = t + refractory_us;
          events.push_back({t + static_cast<uint32_t>(random() % 50), x, y, now});
        }
      }
    }
    const auto noise = static_cast<size_t>(noise_per_s * 1e-6 * duration_us);
    for (size_t i = 0; i < noise; ++i) {
      events.push_back({static_cast<uint32_t>(random() % duration_us),
                        static_cast<uint32_t>(random() % kWidth),
                        static_cast<uint32_t>(random() % kHeight), random() % 2 == 0});
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const Event& a, const Event& b) { return a.time_us < b.time_us; });
    return events;
  }

  static constexpr uint32_t kWidth = 200, kHeight = 160;
};

BlinkFilter MakeFilter(const std::vector<double>& hz = {500}) {
  BlinkFilterOptions options;
  options.geometry = {Scene::kWidth, Scene::kHeight};
  options.blink_hz = hz;
  return *BlinkFilter::Create(options);
}

std::vector<Event> Together(const std::vector<Scene>& scenes) {
  std::vector<Event> events;
  for (const Scene& scene : scenes) {
    const std::vector<Event> own = scene.Events();
    events.insert(events.end(), own.begin(), own.end());
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const Event& a, const Event& b) { return a.time_us < b.time_us; });
  return events;
}

std::vector<int> FrequenciesOf(const std::vector<BlinkBlob>& blobs) {
  std::vector<int> frequencies;
  for (const BlinkBlob& blob : blobs) frequencies.push_back(blob.frequency);
  return frequencies;
}

std::vector<BlinkBlob> Feed(BlinkFilter* filter, const std::vector<Event>& events,
                            uint32_t until_us, uint32_t origin_us = 0) {
  for (const Event& event : events) {
    if (event.time_us > until_us) break;
    const PackedEvent packed = {event.time_us + origin_us, static_cast<uint16_t>(event.x),
                                static_cast<uint16_t>(event.y | (event.on ? 0x8000u : 0u))};
    filter->Events({&packed, 1});
  }
  return filter->FindBlobs(until_us + origin_us);
}

TEST(BlinkFilter, FindsADiscThatStandsStill) {
  const Scene scene;
  BlinkFilter filter = MakeFilter();
  const std::vector<BlinkBlob> blobs = Feed(&filter, scene.Events(), 31'500);
  ASSERT_THAT(blobs, SizeIs(1));
  EXPECT_LT((blobs[0].centre_px - scene.start_px).norm(), 0.1);
  EXPECT_NEAR(blobs[0].area_px, M_PI * 144, 20);
  // Lit from 30 000 to 31 000.
  EXPECT_NEAR(blobs[0].time_us, 30'500, 40);
}

TEST(BlinkFilter, DoesNotLagBehindAMovingDisc) {
  Scene scene;
  scene.speed_px_s = 1000;
  const std::vector<Event> events = scene.Events();
  double along = 0;
  int count = 0;
  for (uint32_t t = 12'000; t < 40'000; t += 370) {
    BlinkFilter filter = MakeFilter();
    const std::vector<BlinkBlob> blobs = Feed(&filter, events, t);
    ASSERT_THAT(blobs, SizeIs(1)) << t;
    const Eigen::Vector2d error = blobs[0].centre_px - scene.CentreAt(blobs[0].time_us);
    EXPECT_LT(error.norm(), 0.3) << t;
    EXPECT_GT(blobs[0].time_us, t - 2 * kPeriodUs);
    EXPECT_LE(blobs[0].time_us, t);
    along += error.x();
    ++count;
  }
  EXPECT_LT(std::abs(along / count), 0.06);
}

TEST(BlinkFilter, KeepsTheFrontThatWasInResetWhenTheLightWentOut) {
  Scene scene;
  scene.speed_px_s = 1000;
  scene.refractory_us = 700;
  const std::vector<Event> events = scene.Events();
  double along = 0;
  int count = 0;
  for (uint32_t t = 12'000; t < 40'000; t += 370) {
    BlinkFilter filter = MakeFilter();
    for (const BlinkBlob& blob : Feed(&filter, events, t)) {
      along += (blob.centre_px - scene.CentreAt(blob.time_us)).x();
      ++count;
    }
  }
  ASSERT_GE(count, 70);  // of 76
  EXPECT_LT(std::abs(along / count), 0.1);
}

TEST(BlinkFilter, OtherFrequenciesAndEdgesAreNotTheWand) {
  for (const double hz : {100.0, 120.0, 240.0, 400.0, 620.0, 1000.0}) {
    Scene scene;
    scene.hz = hz;
    BlinkFilter filter = MakeFilter();
    EXPECT_THAT(Feed(&filter, scene.Events(), 35'000), IsEmpty()) << hz;
  }
  Scene edge;  // a disc that only moves
  edge.hz = 1;
  edge.speed_px_s = 1500;
  BlinkFilter filter = MakeFilter();
  EXPECT_THAT(Feed(&filter, edge.Events(), 35'000), IsEmpty());
}

TEST(BlinkFilter, StandsNoise) {
  Scene scene;
  scene.speed_px_s = 500;
  scene.noise_per_s = 1e6;  // 31 per pixel and second
  BlinkFilter filter = MakeFilter();
  const std::vector<BlinkBlob> blobs = Feed(&filter, scene.Events(), 31'500);
  ASSERT_THAT(blobs, SizeIs(1));
  EXPECT_LT((blobs[0].centre_px - scene.CentreAt(blobs[0].time_us)).norm(), 0.35);
}

TEST(BlinkFilter, KnowsOtherFrequencies) {
  for (const double hz : {100.0, 250.0, 1500.0}) {
    Scene scene;
    scene.hz = hz;
    scene.duration_us = 60'000;
    BlinkFilter filter = MakeFilter({hz});
    EXPECT_THAT(Feed(&filter, scene.Events(), 59'000), SizeIs(1)) << hz;
  }
}

// Above the middle of the image, below it and in it.
std::vector<Scene> ThreeDiscs(const std::vector<double>& hz) {
  std::vector<Scene> discs(3);
  for (size_t i = 0; i < 3; ++i) {
    discs[i].hz = hz[i];
    discs[i].speed_px_s = 600;
    discs[i].noise_per_s = 50'000;
  }
  discs[0].start_px = {60.2, 40.7};
  discs[1].start_px = {120.6, 120.4};
  discs[2].start_px = {50.9, 80.3};
  return discs;
}

TEST(BlinkFilter, TellsFrequenciesApart) {
  const std::vector<double> hz = {500, 620, 400};
  const std::vector<Scene> discs = ThreeDiscs(hz);
  const std::vector<Event> events = Together(discs);
  for (uint32_t t = 20'000; t < 38'000; t += 731) {
    BlinkFilter filter = MakeFilter(hz);
    const std::vector<BlinkBlob> blobs = Feed(&filter, events, t);
    ASSERT_THAT(FrequenciesOf(blobs), ElementsAre(0, 1, 2)) << t;
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_LT((blobs[i].centre_px - discs[i].CentreAt(blobs[i].time_us)).norm(), 0.4) << t;
      // All near one time.
      EXPECT_NEAR(blobs[i].time_us, t - 2000, 1400) << t;
    }
  }
}

TEST(BlinkFilter, WhatBlinksBetweenFrequenciesIsNeither) {
  for (const double hz : {330.0, 445.0, 450.0, 556.0, 720.0}) {
    Scene scene;
    scene.hz = hz;
    BlinkFilter filter = MakeFilter({400, 500, 620});
    EXPECT_THAT(Feed(&filter, scene.Events(), 35'000), IsEmpty()) << hz;
  }
}

TEST(BlinkFilter, DiscsOfTwoFrequenciesThatTouchAreTwo) {
  std::vector<Scene> discs(2);
  discs[0].hz = 400;
  discs[1].hz = 500;
  discs[0].start_px = {70.3, 80.4};
  discs[1].start_px = {94.8, 80.1};  // radii of 12 each
  const std::vector<Event> events = Together(discs);
  for (uint32_t t = 20'000; t < 38'000; t += 731) {
    BlinkFilter filter = MakeFilter({400, 500});
    const std::vector<BlinkBlob> blobs = Feed(&filter, events, t);
    ASSERT_THAT(FrequenciesOf(blobs), ElementsAre(0, 1)) << t;
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_LT((blobs[i].centre_px - discs[i].start_px).norm(), 0.2) << t;
    }
  }
}

TEST(BlinkFilter, NoiseInAndAroundADiscMovesItsCentreLittle) {
  Scene scene;
  std::vector<Event> events = scene.Events();
  // Pixels in reset: a sixteenth of the disc emits nothing in the last burst; and a tail of three
  // lit pixels beside it.
  std::erase_if(events, [](const Event& event) {
    return event.time_us > 30'000 && event.x > 100 && event.x % 4 == 0 && event.y % 4 == 0;
  });
  for (uint32_t x = 113; x < 116; ++x) events.push_back({30'400, x, 81, true});
  std::stable_sort(events.begin(), events.end(),
                   [](const Event& a, const Event& b) { return a.time_us < b.time_us; });
  BlinkFilter filter = MakeFilter();
  const std::vector<BlinkBlob> blobs = Feed(&filter, events, 31'500);
  ASSERT_THAT(blobs, SizeIs(1));
  EXPECT_LT((blobs[0].centre_px - scene.start_px).norm(), 0.06);
}

TEST(BlinkFilter, RefusesFrequenciesThatAreTooClose) {
  BlinkFilterOptions options;
  options.geometry = {Scene::kWidth, Scene::kHeight};
  options.blink_hz = {390, 620, 640};
  EXPECT_THAT(BlinkFilter::Create(options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("620 and 640 Hz are too close"), HasSubstr("1.1 times"),
                             HasSubstr("390 and 640 Hz are too far apart"))));
  options.blink_hz = {};
  EXPECT_THAT(BlinkFilter::Create(options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no blink frequency")));
}

TEST(BlinkFilter, TimeMayOverflow) {
  const Scene scene;
  BlinkFilter filter = MakeFilter();
  const std::vector<BlinkBlob> blobs = Feed(&filter, scene.Events(), 31'500, 0xffffffffu - 20'000);
  ASSERT_THAT(blobs, SizeIs(1));
  EXPECT_LT((blobs[0].centre_px - scene.start_px).norm(), 0.1);
}

TEST(BlinkFilter, ForgetsWhatHasGoneDark) {
  const Scene scene;
  BlinkFilter filter = MakeFilter();
  Feed(&filter, scene.Events(), 40'000);
  // The time of a pixel comes round after 65 536 units of 2 us.
  for (uint32_t t = 40'000; t <= 1'400'000; t += 10'000) {
    filter.Sweep(t);
    if (t >= 50'000) {
      EXPECT_THAT(filter.FindBlobs(t), IsEmpty()) << t;
    }
  }
}

TEST(BlinkFilter, ForgetsHoweverOftenItSweeps) {
  const Scene scene;
  for (const uint32_t step_us : {3u, 1'999u, 20'000u}) {
    BlinkFilter filter = MakeFilter();
    Feed(&filter, scene.Events(), 40'000);
    uint32_t checked_us = 45'000;
    for (uint32_t t = 40'000; t <= 340'000; t += step_us) {
      filter.Sweep(t);
      if (t < checked_us) continue;
      ASSERT_THAT(filter.FindBlobs(t), IsEmpty()) << t << ", every " << step_us;
      checked_us = t + 500;
    }
  }
}

TEST(BlinkFilter, NamesEveryFault) {
  BlinkFilterOptions options;
  options.blink_hz = {0};
  EXPECT_THAT(BlinkFilter::Create(options),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("width is 0"), HasSubstr("blink frequency"))));
}

}  // namespace
}  // namespace rigcal::agent::blink_filter_test
