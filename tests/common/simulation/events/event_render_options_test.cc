// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/events/event_render_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::event_render_options_test {
namespace {

using ::rigcal::testing::OptionsFrom;
using ::testing::HasSubstr;

TEST(EventRenderOptions, ReadsWhatItWrites) {
  EventRenderOptions options;
  options.seed = 9;
  options.refractory_us = 712.25;
  options.bar_contrast = -0.3;
  options.lamps = 0;
  const std::string text = FormatOptions(options);
  EXPECT_EQ(text, "seed=9;refractory=712.25;bar_contrast=-0.3;lamps=0");
  ASSERT_OK_AND_ASSIGN(const EventRenderOptions read, OptionsFrom<EventRenderOptions>(text));
  EXPECT_EQ(read, options);
  EXPECT_EQ(FormatOptions(EventRenderOptions()), "");
}

TEST(EventRenderOptions, RefusesWhatItDoesNotKnow) {
  for (const char* text : {"fog=1", "latency", "latency=fast", "latency=nan", "leak=-1",
                           "leak=1;leak=2", "seed=1.5"}) {
    EXPECT_FALSE(OptionsFrom<EventRenderOptions>(text).ok()) << text;
  }
  EXPECT_THAT(std::string(OptionsFrom<EventRenderOptions>("fog=1").status().message()),
              HasSubstr("refractory"));
}

TEST(EventRenderOptions, ListsEveryFault) {
  EventRenderOptions options;
  options.on_threshold = std::nan("");
  options.row_ns = -1;
  const std::string message(options.Validate().message());
  EXPECT_THAT(message, HasSubstr("on_threshold"));
  EXPECT_THAT(message, HasSubstr("row_ns"));
}

}  // namespace
}  // namespace rigcal::event_render_options_test
