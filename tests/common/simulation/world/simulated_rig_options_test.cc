// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/simulated_rig_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/testing/status_matchers.h"

namespace rigcal::simulated_rig_options_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

TEST(SimulatedRigOptions, WithoutPixelsIsTheWorldAlone) {
  ASSERT_OK_AND_ASSIGN(const SimulatedRigOptions options, ParseSimulatedRigOptions("cameras=4"));
  EXPECT_EQ(options.world.camera_count, 4);
  EXPECT_FALSE(options.frames);
  EXPECT_EQ(options.event_cameras, 0);
}

TEST(SimulatedRigOptions, ReadsSpeedAsTheWands) {
  ASSERT_OK_AND_ASSIGN(const SimulatedRigOptions options, ParseSimulatedRigOptions("speed=3"));
  EXPECT_EQ(options.world.max_speed_m_s, 3);
  EXPECT_THAT(ParseSimulatedRigOptions("speed=3;wand_speed=3"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("twice")));
}

TEST(SimulatedRigOptions, TellsFramesFromTheWorld) {
  ASSERT_OK_AND_ASSIGN(
      const SimulatedRigOptions options,
      ParseSimulatedRigOptions("cameras=6;seed=7;pixels=1;lux=300;events=2;offset.2=0.008"));
  EXPECT_EQ(options.world.seed, 7u);
  EXPECT_EQ(options.world.time_offset_s.at(2), 0.008);
  ASSERT_TRUE(options.frames);
  EXPECT_EQ(options.frames->seed, 7u);
  EXPECT_EQ(options.frames->lux, 300);
  EXPECT_EQ(options.event_cameras, 2);
}

TEST(SimulatedRigOptions, TellsTheEventSensorFromTheWorld) {
  ASSERT_OK_AND_ASSIGN(
      const SimulatedRigOptions options,
      ParseSimulatedRigOptions(
          "cameras=6;seed=7;pixels=1;lux=300;events=2;rate=50;background=2;output=500;"
          "event_clock=cable"));
  EXPECT_EQ(options.world.rate_hz, 50);
  EXPECT_EQ(options.sensors.background_hz, 2);
  EXPECT_EQ(options.sensors.seed, 7u);
  EXPECT_EQ(options.output_hz, 500);
  EXPECT_EQ(options.event_clock, "cable");
  EXPECT_EQ(options.frames->lux, 300);
}

TEST(SimulatedRigOptions, RefusesWhatDoesNotFit) {
  for (const char* part : {"background=2", "output=200", "event_clock=cable"}) {
    EXPECT_THAT(ParseSimulatedRigOptions(std::string("cameras=4;pixels=1;") + part),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(part)));
  }
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;pixels=1;events=2;output=5"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("10 to 1000")));
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;pixels=1;events=2;event_clock="),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("event_clock")));
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;lux=300"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("lux")));
  EXPECT_THAT(
      ParseSimulatedRigOptions("cameras=4;light_code=3"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("light_code=3 needs pixels=1")));
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;light_kode=3"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("unknown option")));
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;events=2"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("needs pixels=1")));
  EXPECT_THAT(ParseSimulatedRigOptions("cameras=4;pixels=1;events=5"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("as many cameras")));
  EXPECT_THAT(
      ParseSimulatedRigOptions("cameras=4;pixels=1;events=x"),
      StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("events=x must be a whole number")));
}

}  // namespace
}  // namespace rigcal::simulated_rig_options_test
