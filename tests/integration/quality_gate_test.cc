// SPDX-License-Identifier: Apache-2.0
// A calibration below the quality gate has its own exit code, and reports the cause.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/recorded_rig.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::quality_gate_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

class BadRecording : public ::testing::Test {
 protected:
  void SetUp() override {
    SimulationOptions options;
    options.camera_count = 4;
    options.duration_s = 30;
    options.rate_hz = 10;
    WriteRecordedRig(options, data());
    // The lens of sim_1 was zoomed by 15 % after its calibration.
    const fs::path file = data() / "sim_1.yaml";
    std::ifstream stream(file);
    std::string text(std::istreambuf_iterator<char>(stream), {});
    const size_t begin = text.find('[', text.find("camera_matrix")) + 1;
    const size_t end = text.find(']', begin);
    ASSERT_NE(end, std::string::npos) << text;
    // OpenCV writes "0.", which is not JSON.
    std::vector<double> matrix;
    std::stringstream values(text.substr(begin, end - begin));
    for (std::string value; std::getline(values, value, ',');) matrix.push_back(std::stod(value));
    ASSERT_EQ(matrix.size(), 9u);
    matrix[0] *= 1.15;
    matrix[4] *= 1.15;
    std::string changed;
    for (const double value : matrix) {
      changed += (changed.empty() ? "" : ", ") + std::to_string(value);
    }
    text.replace(begin, end - begin, changed);
    std::ofstream(file) << text;
  }
  fs::path data() const { return directory_.path() / "rig"; }
  CommandResult Local(const std::string& intrinsics) const {
    return RunCommand({"rigcal", "local", "--data", data().string(), "--target", "wand:0,0.13,0.39",
                       "--intrinsics", intrinsics, "-o", "json"});
  }

  TemporaryDirectory directory_;
};

TEST_F(BadRecording, EndsWithExitCode3AndTheCause) {
  const CommandResult result = Local("fixed");
  EXPECT_EQ(result.exit_code, 3) << result.error;
  const json calibration = json::parse(result.output);
  EXPECT_EQ(calibration["state"], "STATE_SUCCEEDED");
  EXPECT_EQ(calibration["quality"]["grade"], "GRADE_BAD");
  EXPECT_FALSE(calibration["quality"]["reasons"].empty());
  ASSERT_FALSE(calibration["findings"].empty());
  EXPECT_EQ(calibration["findings"][0]["kind"], "FINDING_KIND_WRONG_INTRINSICS");
  EXPECT_EQ(calibration["findings"][0]["camera"], "sim_1");
  EXPECT_THAT(calibration["findings"][0]["advice"].get<std::string>(),
              HasSubstr("focal lengths -1"));
  EXPECT_FALSE(calibration.contains("camera_covariance"));
}

TEST_F(BadRecording, RefinementFixesIt) {
  const CommandResult result = Local("refined");
  EXPECT_EQ(result.exit_code, 0) << result.error;
  EXPECT_NE(json::parse(result.output)["quality"]["grade"], "GRADE_BAD");
}

}  // namespace
}  // namespace rigcal::testing::quality_gate_test
