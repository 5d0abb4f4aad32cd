// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/event_readout.h"

#include <gtest/gtest.h>

namespace rigcal {
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
}  // namespace rigcal
