// SPDX-License-Identifier: Apache-2.0
// The whole solve with cameras whose rows are exposed one after the other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/solve/calibrate.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::rolling_shutter_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;

SimulatedWorld World(std::string_view text) {
  absl::StatusOr<SimulationOptions> options = ParseSimulationOptions(text);
  EXPECT_THAT(options, IsOk());
  absl::StatusOr<SimulatedWorld> world = SimulatedWorld::Create(*options, WandTarget());
  EXPECT_THAT(world, IsOk());
  return *std::move(world);
}

const Finding* FindingOf(FindingKind kind, const CalibrationResult& result,
                         const std::string& camera) {
  for (const Finding& finding : result.findings) {
    if (finding.kind == kind && finding.camera == camera) return &finding;
  }
  return nullptr;
}

TEST(RollingShutters, AreEstimatedInAllCameras) {
  std::string text = "cameras=5;duration=20;seed=4";
  const double delays_us[] = {15, 5, -20, 30, 36};
  for (int c = 0; c < 5; ++c) {
    absl::StrAppend(&text, ";line_delay.", c, "=", absl::StrCat(1e-6 * delays_us[c]));
  }
  const SimulatedWorld world = World(text);
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  const CalibrationResult& result = *outcome.result;
  for (size_t c = 0; c < result.cameras.size(); ++c) {
    const CalibratedCamera& camera = result.cameras[c];
    SCOPED_TRACE(camera.camera);
    EXPECT_GT(camera.line_delay_sigma_s, 0);
    EXPECT_LT(camera.line_delay_sigma_s, 1.5e-6);
    EXPECT_LT(std::abs(camera.line_delay_s - 1e-6 * delays_us[c]), 4 * camera.line_delay_sigma_s);
    const Finding* const finding = FindingOf(FindingKind::kRollingShutter, result, camera.camera);
    if (std::abs(delays_us[c]) > 10) {
      ASSERT_NE(finding, nullptr);
    }
    if (finding != nullptr) {
      EXPECT_EQ(finding->severity, FindingSeverity::kInfo);
    }
    // No clock is off.
    EXPECT_EQ(FindingOf(FindingKind::kClockOffset, result, camera.camera), nullptr);
  }
  // About as good as with global shutters.
  EXPECT_LT(ComparePoses(result, world).worst_position_m, 0.003);
}

TEST(RollingShutters, AreNotInventedWhereThereAreNone) {
  for (const int seed : {1, 2, 3}) {
    const SimulatedWorld world =
        World(absl::StrCat("cameras=4;duration=15;offset.2=0.003;seed=", seed));
    const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
    ASSERT_THAT(outcome.result, IsOk());
    for (const CalibratedCamera& camera : outcome.result->cameras) {
      EXPECT_EQ(camera.line_delay_s, 0);
      EXPECT_EQ(camera.line_delay_sigma_s, 0);
    }
  }
}

// 50 us a row are 51 ms over the image, of frames every 40 ms.
TEST(RollingShutters, AreReadWithinAFramesPeriod) {
  const SimulatedWorld world = World("cameras=4;duration=20;seed=4;line_delay.1=5e-5");
  const CalibrationOutcome outcome = Calibrate(InputOf(world), {});
  ASSERT_THAT(outcome.result, IsOk());
  const auto camera =
      std::ranges::find(outcome.result->cameras, "sim_1", &CalibratedCamera::camera);
  EXPECT_NEAR(camera->line_delay_s * 1024, 0.04, 1e-6);
  const Finding* const finding = FindingOf(FindingKind::kRollingShutter, *outcome.result, "sim_1");
  ASSERT_NE(finding, nullptr);
  EXPECT_THAT(finding->advice, ::testing::HasSubstr("the longest that is possible"));
}

// Stamps of arrival in one camera say nothing about the shutters of the others.
TEST(RollingShutters, AreFoundBesideACameraWhoseStampsJitter) {
  const SimulatedWorld world =
      World("cameras=5;duration=20;seed=4;line_delay.0=2e-5;line_delay.1=3e-5;line_delay.3=-2e-5");
  CalibrationInput input = InputOf(world);
  std::mt19937 random(3);
  std::uniform_int_distribution<int64_t> late_ns(0, 20'000'000);
  for (Observation& row : input.tracks[2].observations) row.time_ns += late_ns(random);
  const CalibrationOutcome outcome = Calibrate(std::move(input), {});
  ASSERT_THAT(outcome.result, IsOk());
  const Finding* const jitter = FindingOf(FindingKind::kStampsJitter, *outcome.result, "sim_2");
  ASSERT_NE(jitter, nullptr);
  EXPECT_NEAR(jitter->value, 5.8, 1.5);
  for (const int c : {0, 1, 3}) {
    const std::string name = absl::StrCat("sim_", c);
    const auto camera = std::ranges::find(outcome.result->cameras, name, &CalibratedCamera::camera);
    const double true_s = world.cameras()[static_cast<size_t>(c)].line_delay_s;
    EXPECT_NEAR(camera->line_delay_s, true_s, 0.25 * std::abs(true_s)) << name;
  }
}

}  // namespace
}  // namespace rigcal::server::rolling_shutter_test
