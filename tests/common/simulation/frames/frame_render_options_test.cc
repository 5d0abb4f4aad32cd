// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/frame_render_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::frame_render_options_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::OptionsFrom;
using ::testing::HasSubstr;

std::string ErrorOf(std::string_view text) {
  return std::string(OptionsFrom<FrameRenderOptions>(text).status().message());
}

TEST(FrameRenderOptions, DefaultsAreValidAndWrittenAsNothing) {
  EXPECT_THAT(FrameRenderOptions().Validate(), IsOk());
  EXPECT_EQ(FormatOptions(FrameRenderOptions()), "");
  ASSERT_OK_AND_ASSIGN(const FrameRenderOptions options, OptionsFrom<FrameRenderOptions>(""));
  EXPECT_EQ(options, FrameRenderOptions());
}

TEST(FrameRenderOptions, ReadsWhatItWrites) {
  FrameRenderOptions options;
  options.seed = 77;
  options.exposure_s = 0.0031;
  options.lux = 1234.5;
  options.auto_gain = true;
  options.defocus_disc_px = 1.0 / 3;
  options.clutter = 0.5;
  ASSERT_OK_AND_ASSIGN(const FrameRenderOptions read,
                       OptionsFrom<FrameRenderOptions>(FormatOptions(options)));
  EXPECT_EQ(read, options);
}

TEST(FrameRenderOptions, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT(ErrorOf("luxx=3"), HasSubstr("unknown option \"luxx\"; did you mean \"lux\"?"));
  EXPECT_THAT(ErrorOf("fog=3"), HasSubstr("known: seed, exposure"));
  EXPECT_THAT(ErrorOf("lux"), HasSubstr("is not KEY=VALUE"));
  EXPECT_THAT(ErrorOf("lux=bright"), HasSubstr("must be a number of 0 to 1e+05 lx"));
  EXPECT_THAT(ErrorOf("lux=nan"), HasSubstr("must be a number"));
  EXPECT_THAT(ErrorOf("lux=1;lux=2"), HasSubstr("twice"));
  EXPECT_THAT(ErrorOf("seed=-1"), HasSubstr("whole number"));
  EXPECT_THAT(ErrorOf("auto_gain=2"), HasSubstr("0 or 1"));
}

TEST(FrameRenderOptions, NamesEveryFault) {
  FrameRenderOptions options;
  options.lux = -1;
  options.defocus_px = std::numeric_limits<double>::quiet_NaN();
  options.clutter = 6;
  const std::string message(options.Validate().message());
  EXPECT_THAT(message, HasSubstr("lux=-1"));
  EXPECT_THAT(message, HasSubstr("defocus=nan"));
  EXPECT_THAT(message, HasSubstr("clutter=6"));
  EXPECT_THAT(ErrorOf("exposure=1;blink_hz=90000"), HasSubstr("more than 1000 blinks"));
}

}  // namespace
}  // namespace rigcal::frame_render_options_test
