// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/accuracy/detection/light_code_waves.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::accuracy {
namespace {

using ::rigcal::testing::IsOk;

// From light to pixels and events, through the detectors and the solve.
TEST(LightCode, AlignsClocksThatAreUpToADayApart) {
  LightCodeOptions options;
  options.seeds = 1;
  options.frame_cameras = 2;
  options.event_cameras = 1;
  const auto waves = RunLightCode(options);
  ASSERT_EQ(waves.size(), 1u);
  const LightCodeWave& wave = waves.front();
  ASSERT_THAT(wave.status, IsOk());
  EXPECT_EQ(wave.read, 3);
  EXPECT_EQ(wave.wrong, 0);
  EXPECT_GE(wave.coarse_frames, 0);
  EXPECT_LT(wave.coarse_frames, 1);
  ASSERT_THAT(wave.solved, IsOk());
  EXPECT_LT(wave.solved_s, 1e-4);
}

}  // namespace
}  // namespace rigcal::accuracy
