// SPDX-License-Identifier: Apache-2.0
// The rig of the paper: four frame cameras and two event cameras, each with an agent of its own,
// from rendered frames and events to one calibration, as a user types it. With less noise and
// shorter than deploy/demo.sh, to save time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::event_rig_test {
namespace {

using nlohmann::json;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

constexpr double kDurationS = 10;
constexpr char kRig[] =
    "cameras=6;duration=10;rate=50;pixels=1;events=2;lux=300;background=0.3;bars=1;lamps=1;"
    "hot_pixels=5";
constexpr char kTarget[] = "wand:0,0.13,0.39;diameter=0.04;hz=500";

struct Result {
  std::string table;                    // as printed
  json calibration;                     // as exported; null: failed
  std::map<std::string, json> cameras;  // of that
};

Result Calibrate(const std::string& more) {
  const TemporaryDirectory directory;
  const std::string keep = (directory.path() / "keep").string();
  const CommandResult command =
      RunCommand({"rigcal", "local", "--simulate", absl::StrCat(kRig, more), "--target", kTarget,
                  "--keep", keep});
  EXPECT_EQ(command.exit_code, 0) << command.error;
  Result result;
  result.table = command.output;
  std::ifstream exported(keep + "/export/calibration.json");
  if (command.exit_code == 0) result.calibration = json::parse(exported);
  for (const json& camera : result.calibration["cameras"]) {
    result.cameras[camera["camera"]] = camera;
  }
  return result;
}

const Result& Plain() {
  static const Result* const result = new Result(Calibrate(""));
  return *result;
}

// Runs are compared camera by camera: the median clock differs, camera 0 has no offset in any.
double OffsetSince(const Result& result, const std::string& camera) {
  const auto against_first = [&](const Result& of) {
    return of.cameras.at(camera)["time_offset_s"].get<double>() -
           of.cameras.at("sim_0")["time_offset_s"].get<double>();
  };
  return against_first(result) - against_first(Plain());
}

void ExpectTruth(const Result& result) {
  const json& truth = result.calibration["ground_truth"];
  ASSERT_EQ(truth["cameras"].size(), 6u);
  for (const json& camera : truth["cameras"]) {
    EXPECT_LE(camera["position_error_m"], 0.0015) << camera["camera"];
    EXPECT_LE(camera["rotation_error_deg"], 0.05) << camera["camera"];
  }
  EXPECT_GT(truth["max_position_error_m"], 0.0) << "nothing was compared";
}

TEST(EventRig, CalibratesAllCamerasWithTheirRatesAndNoise) {
  const Result& result = Plain();
  ASSERT_EQ(result.cameras.size(), 6u);
  ExpectTruth(result);
  EXPECT_THAT(result.table, HasSubstr("low pass"));
  double worst_frame_px = 0;
  for (const char* name : {"sim_0", "sim_1", "sim_2", "sim_3"}) {
    EXPECT_THAT(result.table, ContainsRegex(absl::StrCat(name, " +frame +500 +50\\.0 ")));
    const json& residuals = result.cameras.at(name)["residuals"];
    EXPECT_GE(residuals["observation_count"], 200) << name;
    EXPECT_LE(residuals["inlier"]["rms_px"], 0.06) << name;
    worst_frame_px = std::max(worst_frame_px, residuals["inlier"]["rms_px"].get<double>());
  }
  for (const char* name : {"sim_4", "sim_5"}) {
    // A blink is recognised after three periods.
    EXPECT_THAT(result.table, ContainsRegex(absl::StrCat(name,
                                                         " +event +(19|20)[0-9][0-9] +"
                                                         "(199|200)\\.[0-9] ")));
    const json& camera = result.cameras.at(name);
    const json& residuals = camera["residuals"];
    // Between the frames too.
    EXPECT_GE(residuals["observation_count"], 0.9 * 200 * kDurationS) << name;
    EXPECT_GE(residuals["inlier"]["rms_px"], worst_frame_px) << name;
    EXPECT_LE(residuals["inlier"]["rms_px"], 0.2) << name;
    EXPECT_GT(camera["uncertainty"]["time_offset_sigma_s"],
              result.cameras.at("sim_2")["uncertainty"]["time_offset_sigma_s"]);
    // Its pixels answer later than the light: their low pass, and those that are still in their
    // refractory period; 0.05 ms is of the frame cameras (docs/event_cameras.md).
    EXPECT_NEAR(camera["time_offset_s"], -2e-4, 1.5e-4) << name;
    EXPECT_EQ(camera["image_size_px"], json({{"width", 1280}, {"height", 720}}));
  }
}

TEST(EventRig, RecoversAnOffsetOfOneEventCamera) {
  ASSERT_EQ(Plain().cameras.size(), 6u);
  const Result shifted = Calibrate(";offset.5=0.004");
  ASSERT_EQ(shifted.cameras.size(), 6u);
  ExpectTruth(shifted);
  EXPECT_NEAR(OffsetSince(shifted, "sim_5"), 0.004, 1e-4);
  EXPECT_NEAR(OffsetSince(shifted, "sim_4"), 0, 1e-4);
  EXPECT_NEAR(OffsetSince(shifted, "sim_2"), 0, 1e-4);
  // No row is lost although the two event cameras now see different blinks.
  EXPECT_GE(shifted.cameras.at("sim_5")["residuals"]["observation_count"], 0.9 * 200 * kDurationS);
}

TEST(EventRig, SensorsOnOneCableHaveOneOffset) {
  ASSERT_EQ(Plain().cameras.size(), 6u);
  const Result shared = Calibrate(";event_clock=cable;offset.4=0.004;offset.5=0.004");
  ASSERT_EQ(shared.cameras.size(), 6u);
  ExpectTruth(shared);
  const json& left = shared.cameras.at("sim_4");
  const json& right = shared.cameras.at("sim_5");
  EXPECT_EQ(left["clock_id"], "cable");
  EXPECT_EQ(right["clock_id"], "cable");
  EXPECT_EQ(left["time_offset_s"], right["time_offset_s"]);
  EXPECT_EQ(left["uncertainty"]["time_offset_sigma_s"],
            right["uncertainty"]["time_offset_sigma_s"]);
  EXPECT_NE(Plain().cameras.at("sim_4")["time_offset_s"],
            Plain().cameras.at("sim_5")["time_offset_s"]);
  // The mean of the two latencies, which differ a little.
  EXPECT_NEAR(0.5 * (OffsetSince(shared, "sim_4") + OffsetSince(shared, "sim_5")), 0.004, 1e-4);
}

}  // namespace
}  // namespace rigcal::testing::event_rig_test
