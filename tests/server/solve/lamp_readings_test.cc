// SPDX-License-Identifier: Apache-2.0
// The whole solve with readings of lamps by cameras of clocks that differ by much.
#include "server/solve/lamp_readings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::lamp_readings_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

// Origins and rates of their own, and an offset beside what the samples of the PC say.
SimulatedWorld World() {
  absl::StatusOr<SimulationOptions> options = ParseSimulationOptions(
      "cameras=4;duration=20;seed=4;clock_samples=1;offset.1=0.0047;rate_ppm.2=40");
  EXPECT_THAT(options, IsOk());
  absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(*options, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

// What the camera's clock shows at a moment of the rig's time, from its frames.
int64_t DeviceNs(const SimulatedWorld& world, int camera, double rig_time_s) {
  const int last = world.FrameCount(camera) - 1;
  const double first_s = world.FrameRigTime(camera, 0);
  const int64_t first_ns = world.Observe(camera, 0).time_ns;
  const double passed_ns = static_cast<double>(world.Observe(camera, last).time_ns - first_ns) /
                           (world.FrameRigTime(camera, last) - first_s) * (rig_time_s - first_s);
  return first_ns + std::llround(passed_ns);
}

// Lamps of 100 Hz once a second, as the camera reads them with a clock that is late by `late_s`.
void AddLamps(const SimulatedWorld& world, int camera, double late_s, CalibrationInput* input) {
  constexpr double kPeriodS = 0.01;
  CameraTrack& track = input->tracks[static_cast<size_t>(camera)];
  for (int i = 1; i < 19; ++i) {
    const double moment_s = i + 0.5 + kPeriodS * camera / 3;  // on another phase of the mains
    track.clock_samples.push_back(
        {track.observations.front().clock_epoch,
         {.device_ns = DeviceNs(world, camera, moment_s) + std::llround(1e9 * late_s),
          .uncertainty_ns = 50'000,
          .light = kLamps,
          .light_ns = 10'000'000}});
  }
}

CalibrationResult Solve(const CalibrationInput& input) {
  CalibrationOutcome outcome = Calibrate(input, {});
  EXPECT_THAT(outcome.result, IsOk());
  return outcome.result.ok() ? *std::move(outcome.result) : CalibrationResult();
}

std::vector<Finding> Contradictions(const CalibrationResult& result) {
  std::vector<Finding> found;
  for (const Finding& finding : result.findings) {
    if (finding.kind == FindingKind::kLampFlickerContradicts) found.push_back(finding);
  }
  return found;
}

TEST(LampReadings, AgreeWithClocksThatAreRight) {
  const SimulatedWorld world = World();
  CalibrationInput input = InputOf(world);
  for (int c = 0; c < 4; ++c) AddLamps(world, c, 0, &input);
  const CalibrationResult result = Solve(input);
  EXPECT_TRUE(Contradictions(result).empty());
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
}

TEST(LampReadings, ContradictAClock) {
  const SimulatedWorld world = World();
  CalibrationInput input = InputOf(world);
  for (int c = 0; c < 4; ++c) AddLamps(world, c, c == 1 ? 1.3e-3 : 0, &input);
  const CalibrationResult result = Solve(input);
  const std::vector<Finding> found = Contradictions(result);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].camera, world.cameras()[1].description.camera);
  EXPECT_NEAR(found[0].value, 1.3, 0.1);
  EXPECT_EQ(found[0].severity, FindingSeverity::kWarning);
  EXPECT_EQ(result.quality.grade, QualityGrade::kUsable);
}

// What pixels that answer late may explain is told, and no more.
TEST(LampReadings, SmallDifferencesLeaveTheGrade) {
  const SimulatedWorld world = World();
  CalibrationInput input = InputOf(world);
  for (int c = 0; c < 2; ++c) AddLamps(world, c, c == 1 ? 0.8e-3 : 0, &input);
  const CalibrationResult result = Solve(input);
  const std::vector<Finding> found = Contradictions(result);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].severity, FindingSeverity::kInfo);
  EXPECT_EQ(result.quality.grade, QualityGrade::kGood);
}

TEST(LampReadings, OfOneCameraSayNothing) {
  const SimulatedWorld world = World();
  CalibrationInput input = InputOf(world);
  AddLamps(world, 2, 1.3e-3, &input);
  EXPECT_TRUE(Contradictions(Solve(input)).empty());
}

}  // namespace
}  // namespace rigcal::server::lamp_readings_test
