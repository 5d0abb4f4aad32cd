// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_readout.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/simulation/world/random_stream.h"

namespace rigcal::event_readout_test {
namespace {

TEST(EventReadout, ReadsARowAtOnceFromLeftToRight) {
  EventReadout readout(4, 0.1, 0);
  std::vector<PixelRequest> requests = {{10, 7, 2, true}, {10, 3, 2, false}, {5, 1, 1, true}};
  std::vector<SimulatedEvent> events;
  readout.Read(&requests, 250, &events);
  EXPECT_EQ(events,
            (std::vector<SimulatedEvent>{{5, 1, 1, true}, {10, 3, 2, false}, {10, 7, 2, true}}));
  EXPECT_TRUE(requests.empty());
}

TEST(EventReadout, DelaysWhatIsOverTheLimitAndLosesNothing) {
  EventReadout readout(100, 10, 0);
  std::vector<PixelRequest> requests;
  for (uint16_t y = 0; y < 100; ++y) requests.push_back({0, 5, y, true});
  std::vector<SimulatedEvent> events;
  readout.Read(&requests, 250, &events);
  ASSERT_EQ(events.size(), 25u);
  EXPECT_EQ(events[24].time_us, 240);
  EXPECT_EQ(readout.waiting(), 75u);
  readout.Read(&requests, 2000, &events);
  ASSERT_EQ(events.size(), 100u);
  for (size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].time_us, static_cast<int64_t>(10 * i));
    EXPECT_EQ(events[i].y, i);
  }
  EXPECT_EQ(readout.lost(), 0u);
}

// Many, some of one time, against what a free bus must read: all in order of time.
TEST(EventReadout, AnyOrderOfRequestsGivesTheSameEvents) {
  RandomStream draw{5, 5};
  std::vector<PixelRequest> requests;
  for (int i = 0; i < 20000; ++i) {
    const double time_us = i % 3 == 0 ? 500 : draw.Uniform(0, 1000);
    requests.push_back({time_us, static_cast<uint16_t>(draw.Uniform(0, 64)),
                        static_cast<uint16_t>(draw.Uniform(0, 48)), draw.Uniform() < 0.5});
  }
  std::vector<PixelRequest> backwards(requests.rbegin(), requests.rend());
  EventReadout one(48, 0.01, 0.001), other(48, 0.01, 0.001);
  std::vector<SimulatedEvent> events, others;
  one.Read(&requests, 2000, &events);
  other.Read(&backwards, 2000, &others);
  ASSERT_EQ(events.size(), 20000u);
  EXPECT_TRUE(events == others);
  EXPECT_TRUE(std::is_sorted(events.begin(), events.end(),
                             [](const auto& a, const auto& b) { return a.time_us < b.time_us; }));
}

TEST(EventReadout, NextRowIsTheNextBelowThatWaits) {
  EventReadout readout(10, 5, 0);
  std::vector<PixelRequest> requests = {{0, 0, 4, true}, {1, 0, 2, true}, {2, 0, 7, true}};
  std::vector<SimulatedEvent> events;
  readout.Read(&requests, 100, &events);
  ASSERT_EQ(events.size(), 3u);
  EXPECT_EQ(events[0].y, 4);
  EXPECT_EQ(events[1].y, 7);  // below row 4, though row 2 asked first
  EXPECT_EQ(events[2].y, 2);
  EXPECT_EQ(events[2].time_us, 10);
}

TEST(EventReadout, CountsWhatDoesNotFit) {
  EventReadout readout(1, 1e9, 0);
  std::vector<PixelRequest> requests(1000100, PixelRequest{1, 0, 0, true});
  std::vector<SimulatedEvent> events;
  readout.Read(&requests, 1, &events);
  EXPECT_TRUE(events.empty());
  EXPECT_EQ(readout.waiting(), 1000000u);
  EXPECT_EQ(readout.lost(), 100u);
}

}  // namespace
}  // namespace rigcal::event_readout_test
