// SPDX-License-Identifier: Apache-2.0
// What `-o json` promises to programs.
#include "client/output/output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/client/sample_messages.h"

namespace rigcal::client::output_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

json CalibrationJson() { return json::parse(ToJson(testing::FullCalibration())); }

TEST(CalibrationJson, HasTheTopLevelFields) {
  const json calibration = CalibrationJson();
  EXPECT_EQ(calibration.at("state"), "STATE_SUCCEEDED");
  EXPECT_EQ(calibration.at("scale_known"), true);
  EXPECT_TRUE(calibration.at("instant_count").is_number_unsigned());
  EXPECT_EQ(calibration.at("instant_count"), 614);
  EXPECT_EQ(calibration.at("version"), 3);
  EXPECT_EQ(calibration.at("cameras").size(), 2u);
}

TEST(CalibrationJson, HasThePoseAndIntrinsicsOfEachCamera) {
  const json camera = CalibrationJson().at("cameras").at(1);
  EXPECT_EQ(camera.at("camera"), "right");
  EXPECT_EQ(camera.at("image_size_px"), json({{"width", 1280}, {"height", 1024}}));
  const json pose = camera.at("cam_from_rig");
  for (const char* part : {"w", "x", "y", "z"}) {
    EXPECT_TRUE(pose.at("rotation").at(part).is_number()) << part;
  }
  for (const char* part : {"x", "y", "z"}) {
    EXPECT_TRUE(pose.at("translation_m").at(part).is_number()) << part;
  }
  EXPECT_NEAR(pose.at("rotation").at("y"), std::sqrt(0.5), 1e-12);
  const json intrinsics = camera.at("intrinsics");
  EXPECT_EQ(intrinsics.at("model"), "MODEL_BROWN_CONRADY");
  EXPECT_EQ(intrinsics.at("fx_px"), 1250.5);
  EXPECT_EQ(intrinsics.at("fy_px"), 1251.5);
  EXPECT_EQ(intrinsics.at("cx_px"), 640.25);
  EXPECT_EQ(intrinsics.at("cy_px"), 512.75);
  EXPECT_EQ(intrinsics.at("distortion"), json({-0.2, 0.1, 0.0, 0.0, 0.05}));
}

TEST(CalibrationJson, HasTheTimeOfEachCamera) {
  const json camera = CalibrationJson().at("cameras").at(0);
  EXPECT_EQ(camera.at("clock_id"), "left");
  EXPECT_EQ(camera.at("time_offset_s"), -0.00815);
  EXPECT_EQ(camera.at("time_rate_ppm"), 1.5);
  EXPECT_EQ(camera.at("time_epoch_s"), 12.5);
}

TEST(CalibrationJson, HasTheResidualsOfEachCamera) {
  const json residuals = CalibrationJson().at("cameras").at(0).at("residuals");
  EXPECT_EQ(residuals.at("all").at("mean_px"), 0.5);
  EXPECT_EQ(residuals.at("all").at("rms_px"), 0.75);
  EXPECT_EQ(residuals.at("all").at("median_px"), 0.25);
  EXPECT_EQ(residuals.at("all").at("p95_px"), 1.5);
  EXPECT_EQ(residuals.at("observation_count"), 600);
  EXPECT_EQ(residuals.at("outlier_count"), 12);
  for (const char* figure : {"mean_px", "rms_px", "median_px", "p95_px"}) {
    EXPECT_TRUE(residuals.at("inlier").at(figure).is_number()) << figure;
  }
}

TEST(CalibrationJson, HasTheTargetAndWhatWasRefused) {
  const json calibration = CalibrationJson();
  EXPECT_EQ(calibration.at("target").at("marker_positions_m"), json({0.0, 0.13, 0.39}));
  EXPECT_EQ(calibration.at("target").at("length_error_rms_m"), 0.00058);
  const json refused = calibration.at("refused").at(0);
  EXPECT_EQ(refused.at("camera"), "left");
  EXPECT_EQ(refused.at("reason"), "REFUSAL_REASON_CLOCK_EPOCH_WITHOUT_OFFSET");
  EXPECT_EQ(refused.at("count"), 6);
}

TEST(CalibrationJson, PrintsDefaults) {
  v1::Calibration empty;
  empty.add_cameras()->mutable_residuals();
  const json calibration = json::parse(ToJson(empty));
  EXPECT_EQ(calibration.at("scale_known"), false);
  EXPECT_EQ(calibration.at("instant_count"), 0);
  EXPECT_EQ(calibration.at("state"), "STATE_UNSPECIFIED");
  EXPECT_EQ(calibration.at("refused"), json::array());
  EXPECT_EQ(calibration.at("cameras").at(0).at("time_offset_s"), 0.0);
  EXPECT_EQ(calibration.at("cameras").at(0).at("residuals").at("outlier_count"), 0);
}

TEST(CalibrationJson, HasNoCountAsText) {
  // 64-bit numbers become strings in protobuf JSON.
  const json calibration = CalibrationJson();
  const std::vector<const json*> open = {&calibration};
  std::vector<const json*> todo = open;
  int numbers = 0;
  while (!todo.empty()) {
    const json* value = todo.back();
    todo.pop_back();
    for (const auto& item : value->items()) {
      if (item.value().is_structured()) todo.push_back(&item.value());
      if (item.key().ends_with("_count") || item.key() == "count" || item.key() == "version") {
        EXPECT_TRUE(item.value().is_number_unsigned()) << item.key();
        ++numbers;
      }
    }
  }
  EXPECT_GT(numbers, 10);
}

TEST(ToJson, OfALineHasNoLineBreaks) {
  EXPECT_THAT(ToJson(testing::FullSession(), /*indented=*/false), Not(HasSubstr("\n")));
  EXPECT_EQ(json::parse(ToJson(testing::FullSession(), false)),
            json::parse(ToJson(testing::FullSession(), true)));
}

}  // namespace
}  // namespace rigcal::client::output_test
