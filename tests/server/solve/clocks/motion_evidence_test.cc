// SPDX-License-Identifier: Apache-2.0
#include "server/solve/clocks/motion_evidence.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>

#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::motion_evidence_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

constexpr int64_t kMillisecondNs = 1'000'000;

CalibrationInput Simulated(const std::string& options) {
  const auto world = SimulatedWorld::Create(*ParseSimulationOptions(options), WandTarget());
  EXPECT_THAT(world, IsOk());
  return InputOf(*world);
}

// What is said of the second half of a camera's rows, which are stamped so much late: whether they
// belong earlier by `step_ns`.
std::optional<bool> Ask(CalibrationInput input, int64_t late_ns, int64_t step_ns) {
  CameraTrack& track = input.tracks[2];
  StepQuestion question{track.session_id, track.camera.camera, {}, 0, -step_ns};
  for (size_t i = track.observations.size() / 2; i < track.observations.size(); ++i) {
    track.observations[i].time_ns += late_ns;
    question.rows.push_back(&track.observations[i]);
  }
  MotionEvidence evidence(input.tracks,
                          [&input](const std::string&) -> const Target& { return input.target; });
  return evidence(question);
}

TEST(MotionEvidence, TellsAStepFromLostFrames) {
  const CalibrationInput input = Simulated("cameras=4;duration=40;rate=20;outliers=0.02");
  for (const int64_t step_ns :
       {350 * kMillisecondNs, 1000 * kMillisecondNs, 5000 * kMillisecondNs}) {
    EXPECT_EQ(Ask(input, step_ns, step_ns), std::optional(true)) << step_ns;
    EXPECT_EQ(Ask(input, 0, step_ns), std::optional(false)) << step_ns;
  }
}

TEST(MotionEvidence, TakesClocksThatAreALittleOff) {
  const CalibrationInput input = Simulated("cameras=4;duration=40;rate=20;offset.2=0.02");
  EXPECT_EQ(Ask(input, 1000 * kMillisecondNs, 1000 * kMillisecondNs), std::optional(true));
  EXPECT_EQ(Ask(input, 0, 1000 * kMillisecondNs), std::optional(false));
}

TEST(MotionEvidence, SaysNothingOfWhatFitsAtNeitherTime) {
  const CalibrationInput input = Simulated("cameras=4;duration=40;rate=20");
  EXPECT_EQ(Ask(input, 7000 * kMillisecondNs, 2000 * kMillisecondNs), std::nullopt);
}

TEST(MotionEvidence, SaysNothingOfACameraThatItDoesNotKnow) {
  const CalibrationInput input = Simulated("cameras=2;duration=10;rate=20");
  MotionEvidence evidence(input.tracks,
                          [&input](const std::string&) -> const Target& { return input.target; });
  EXPECT_EQ(evidence({input.tracks[0].session_id, "nobody", {}, 0, 1}), std::nullopt);
  EXPECT_EQ(evidence({"nowhere", input.tracks[0].camera.camera, {}, 0, 1}), std::nullopt);
}

}  // namespace
}  // namespace rigcal::server::motion_evidence_test
