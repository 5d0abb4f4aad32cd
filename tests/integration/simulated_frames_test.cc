// SPDX-License-Identifier: Apache-2.0
// Four simulated cameras with rendered frames, through agents and server, as a user types it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/process.h"

namespace rigcal::testing::simulated_frames_test {
namespace {

using nlohmann::json;

constexpr char kRig[] = "cameras=4;duration=14;pixels=1;clutter=0.5;lux=300";
constexpr char kTarget[] = "wand:0,0.13,0.39;diameter=0.04;hz=500";

json Calibrate(const std::string& more) {
  const CommandResult result =
      RunCommand({"rigcal", "local", "--simulate", absl::StrCat(kRig, more), "--target", kTarget,
                  "-o", "json"});
  EXPECT_EQ(result.exit_code, 0) << result.error;
  return result.exit_code == 0 ? json::parse(result.output) : json();
}

std::map<std::string, double> OffsetsOf(const json& calibration) {
  std::map<std::string, double> offsets;
  for (const json& camera : calibration["cameras"]) {
    offsets[camera["camera"]] = camera["time_offset_s"];
  }
  return offsets;
}

TEST(SimulatedFrames, CalibrateToGroundTruthAndRecoverOffsets) {
  const json plain = Calibrate("");
  ASSERT_FALSE(plain.is_null());
  EXPECT_LE(plain["ground_truth"]["max_position_error_m"], 0.001);
  EXPECT_GT(plain["ground_truth"]["max_position_error_m"], 0.0) << "nothing was compared";
  EXPECT_LE(plain["ground_truth"]["max_rotation_error_deg"], 0.03);

  const json shifted = Calibrate(";offset.1=0.008;offset.3=-0.03");
  ASSERT_FALSE(shifted.is_null());
  EXPECT_LE(shifted["ground_truth"]["max_position_error_m"], 0.001);
  std::map<std::string, double> before = OffsetsOf(plain), after = OffsetsOf(shifted);
  // Each against camera 0, which has none: the median clock differs between the runs.
  const auto moved = [&](const std::string& camera) {
    return (after[camera] - after["sim_0"]) - (before[camera] - before["sim_0"]);
  };
  EXPECT_NEAR(moved("sim_1"), 0.008, 2e-4);
  EXPECT_NEAR(moved("sim_3"), -0.03, 2e-4);
  EXPECT_NEAR(moved("sim_2"), 0, 2e-4);
}

}  // namespace
}  // namespace rigcal::testing::simulated_frames_test
