// SPDX-License-Identifier: Apache-2.0
// One marker, through real processes, as a user types it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/simulation/world/simulated_world.h"
#include "tests/testing/process.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::point_target_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr char kRig[] = "cameras=5;duration=30;offset.1=0.02";

CommandResult Local(std::vector<std::string> more) {
  std::vector<std::string> command = {"rigcal", "local", "--simulate", kRig, "--target", "point"};
  command.insert(command.end(), more.begin(), more.end());
  return RunCommand(command);
}

double TrueDistanceM(size_t a, size_t b) {
  const SimulatedWorld world =
      *SimulatedWorld::Create(*ParseSimulationOptions(kRig), *ParseTarget("point"));
  return (world.cameras()[a].cam_from_rig.SourceFromTargetTranslation() -
          world.cameras()[b].cam_from_rig.SourceFromTargetTranslation())
      .norm();
}

TEST(PointTarget, IsCalibratedUpToScaleAndClaimsNoMetres) {
  const CommandResult result = Local({"-o", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json calibration = json::parse(result.output);
  EXPECT_EQ(calibration["scale_known"], false);
  EXPECT_EQ(calibration["reference_camera"], "sim_0");
  const std::string unit_camera = calibration["unit_camera"];
  EXPECT_THAT(unit_camera, Not(IsEmpty()));
  EXPECT_THAT(calibration["target"]["spans"], IsEmpty());
  EXPECT_EQ(calibration["target"]["scale_sigma_rel"], 0);
  EXPECT_FALSE(calibration.contains("wand_volume"));
  // Against ground truth after a similarity; 2 mm as for the wand.
  EXPECT_LE(calibration["ground_truth"]["max_position_error_m"], 0.002);
  EXPECT_GT(calibration["ground_truth"]["max_position_error_m"], 0.0) << "nothing was compared";
  EXPECT_LE(calibration["ground_truth"]["max_rotation_error_deg"], 0.05);
  const double unit_m = calibration["ground_truth"]["unit_length_m"];
  EXPECT_NEAR(unit_m, TrueDistanceM(0, static_cast<size_t>(unit_camera.back() - '0')), 0.004);
  EXPECT_NEAR(calibration["cameras"][1]["time_offset_s"], 0.02, 5e-4);
}

TEST(PointTarget, TableAndExportsClaimNoMetresEither) {
  const TemporaryDirectory directory;
  const std::filesystem::path keep = directory.path() / "run";
  const CommandResult result = Local({"--keep", keep.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_THAT(result.output,
              AllOf(HasSubstr("NOT KNOWN"), HasSubstr("the unit is the distance from sim_0 to"),
                    HasSubstr("position (unknown scale)"), HasSubstr("similarity"),
                    Not(HasSubstr("position (m)")), Not(HasSubstr("wand length"))));
  int yaml_files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(keep)) {
    const bool is_export = entry.path().extension() == ".yaml" &&
                           entry.path().filename().string().rfind("sim_", 0) == 0;
    yaml_files += is_export ? 1 : 0;
  }
  EXPECT_EQ(yaml_files, 0) << "these promise metres";
}

TEST(PointTarget, IsMetricWithAKnownDistance) {
  const std::string distance = absl::StrCat("sim_1,sim_3,", TrueDistanceM(1, 3), ",0.004");
  const CommandResult result = Local({"--distance", distance, "-o", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json calibration = json::parse(result.output);
  EXPECT_EQ(calibration["scale_known"], true);
  EXPECT_EQ(calibration["unit_camera"], "");
  EXPECT_NEAR(calibration["target"]["scale_sigma_rel"], 0.004 / TrueDistanceM(1, 3), 1e-6);
  EXPECT_EQ(calibration["ground_truth"]["unit_length_m"], 0);
  EXPECT_LE(calibration["ground_truth"]["max_position_error_m"], 0.002);
  EXPECT_LE(calibration["ground_truth"]["max_rotation_error_deg"], 0.05);
}

TEST(PointTarget, RefusesAnUnusableDistance) {
  const CommandResult unknown = Local({"--distance", "sim_1,cellar,2"});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.error, AllOf(HasSubstr("cellar"), HasSubstr("sim_4")));
  for (const char* distance : {"sim_1,sim_1,2", "sim_1,sim_2,nan", "sim_1,sim_2,0",
                               "sim_1,sim_2,2,-1", "sim_1,sim_2", "sim_1,sim_2,2,0.1,3"}) {
    const CommandResult result = Local({"--distance", distance});
    EXPECT_EQ(result.exit_code, 2) << distance;
    EXPECT_THAT(result.error, HasSubstr(distance));
  }
}

}  // namespace
}  // namespace rigcal::testing::point_target_test
