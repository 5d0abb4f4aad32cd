// SPDX-License-Identifier: Apache-2.0
// `rigcal local` through real processes, as a user types it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/recorded_data.h"
#include "tests/testing/recorded_rig.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::local_command_test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
namespace fs = std::filesystem;

constexpr char kTarget[] = "wand:0,0.13,0.39";

// The `refused` entry of a calibration for this camera and reason; count 0 when there is none.
uint32_t RefusedCount(const json& calibration, const std::string& camera,
                      const std::string& reason) {
  for (const json& refused : calibration["refused"]) {
    if (refused["camera"] == camera && refused["reason"] == reason) return refused["count"];
  }
  return 0;
}

json WithoutIdentity(json calibration) {
  for (const char* field : {"id", "version", "session_ids", "run"}) calibration.erase(field);
  return calibration;
}

TEST(LocalCommand, CalibratesTheRealRecording) {
  RIGCAL_REQUIRE_RECORDED_DATA(data);
  const std::vector<std::string> command = {
      "rigcal", "local", "--data", (data / "ewand").string(), "--target", kTarget, "-o", "json"};
  const CommandResult result = RunCommand(command);
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json calibration = json::parse(result.output);
  EXPECT_EQ(calibration["state"], "STATE_SUCCEEDED");
  EXPECT_EQ(calibration["scale_known"], true);
  // 614 instants are seen by two or more cameras.
  EXPECT_GE(calibration["instant_count"], 600);
  ASSERT_EQ(calibration["cameras"].size(), 4u);
  double sum_px = 0;
  for (const json& camera : calibration["cameras"]) {
    const double mean_px = camera["residuals"]["all"]["mean_px"];
    sum_px += mean_px;
    // The published solver leaves 2.12 px on average and 3.0 at worst.
    EXPECT_LE(mean_px, 3.0) << camera["camera"];
    EXPECT_GT(mean_px, 0.05) << camera["camera"];
    EXPECT_EQ(camera["image_size_px"], json({{"width", 1280}, {"height", 1024}}));
    EXPECT_GT(camera["residuals"]["observation_count"], 300);
  }
  EXPECT_LE(sum_px / 4, 1.5);
  // Camera 0 ends with 6 rows whose clock has jumped back.
  EXPECT_EQ(RefusedCount(calibration, "frame_0", "REFUSAL_REASON_CLOCK_EPOCH_WITHOUT_OFFSET"), 6u);

  const CommandResult again = RunCommand(command);
  ASSERT_EQ(again.exit_code, 0) << again.error;
  EXPECT_EQ(WithoutIdentity(json::parse(again.output)), WithoutIdentity(calibration));
}

TEST(LocalCommand, CalibratesASimulatedRigToGroundTruth) {
  const CommandResult result =
      RunCommand({"rigcal", "local", "--simulate", "", "--target", kTarget, "-o", "json"});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json calibration = json::parse(result.output);
  ASSERT_EQ(calibration["cameras"].size(), 6u);
  ASSERT_EQ(calibration["ground_truth"]["cameras"].size(), 6u);
  // Requirements for 0.3 px of noise, 2 % outliers, nominal spacing.
  EXPECT_LE(calibration["ground_truth"]["max_position_error_m"], 0.002);
  EXPECT_LE(calibration["ground_truth"]["max_rotation_error_deg"], 0.05);
  EXPECT_GT(calibration["ground_truth"]["max_position_error_m"], 0.0) << "nothing was compared";
}

// A small rig as files, with whatever a test wants to break in it.
class LocalCommandFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    SimulationOptions options;
    options.camera_count = 3;
    options.duration_s = 20;
    options.rate_hz = 10;
    WriteRecordedRig(options, data());
  }

  fs::path data() const { return directory_.path() / "my rig"; }  // a space, as people have them
  std::string ReadFile(const std::string& name) const {
    std::ifstream stream(data() / name);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  void WriteFile(const std::string& name, const std::string& text) const {
    std::ofstream(data() / name) << text;
  }
  CommandResult Local(std::vector<std::string> more = {}, const std::string& target = kTarget) {
    std::vector<std::string> command = {"rigcal",   "local", "--data", data().string(),
                                        "--target", target,  "-o",     "json"};
    command.insert(command.end(), more.begin(), more.end());
    CommandResult result = RunCommand(command);
    EXPECT_THAT(ProcessesWith(data().string()), IsEmpty()) << "processes stay behind";
    return result;
  }

  const TemporaryDirectory directory_;
};

TEST_F(LocalCommandFiles, CalibratesAndLeavesNothingRunning) {
  const CommandResult result = Local();
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(json::parse(result.output)["cameras"].size(), 3u);
}

TEST_F(LocalCommandFiles, KeepsStoreAndLogsWhenAsked) {
  const fs::path keep = directory_.path() / "keep";
  const CommandResult result = Local({"--keep", keep.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_FALSE(fs::is_empty(keep));
  EXPECT_THAT(result.error, HasSubstr(keep.string()));
}

TEST_F(LocalCommandFiles, TableShowsEveryCamera) {
  const CommandResult result =
      RunCommand({"rigcal", "local", "--data", data().string(), "--target", kTarget});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  for (const char* part : {"sim_0", "sim_1", "sim_2", "mean", "rms", "median", "p95", "instants"}) {
    EXPECT_THAT(result.output, HasSubstr(part));
  }
}

TEST_F(LocalCommandFiles, DamagedLinesAreCountedAndNamed) {
  std::string text = ReadFile("sim_1.csv");
  WriteFile("sim_1.csv", "1;2;3\nhello;1;2;3;4;5;6\n2000;inf;2;3;4;5;6\n" + text);
  const CommandResult result = Local();
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const json calibration = json::parse(result.output);
  EXPECT_EQ(RefusedCount(calibration, "sim_1", "REFUSAL_REASON_CSV_FIELD_COUNT"), 1u);
  EXPECT_EQ(RefusedCount(calibration, "sim_1", "REFUSAL_REASON_CSV_NOT_A_NUMBER") +
                RefusedCount(calibration, "sim_1", "REFUSAL_REASON_CSV_BAD_TIME"),
            1u);
  EXPECT_EQ(RefusedCount(calibration, "sim_1", "REFUSAL_REASON_CSV_NOT_FINITE"), 1u);
  EXPECT_THAT(result.output, HasSubstr("sim_1.csv:1"));
}

TEST_F(LocalCommandFiles, DuplicatesAreJudged) {
  std::string text = ReadFile("sim_0.csv");
  const std::string first = text.substr(0, text.find('\n') + 1);
  WriteFile("sim_0.csv", first + text);  // the same row twice: one is kept
  const CommandResult result = Local();
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(RefusedCount(json::parse(result.output), "sim_0", "REFUSAL_REASON_DUPLICATE_EQUAL"),
            1u);
}

TEST_F(LocalCommandFiles, ClockThatJumpsBackIsACountedEpoch) {
  // A row that was not there before: one that comes again would be used once.
  const std::string other = ReadFile("sim_1.csv");
  WriteFile("sim_0.csv", ReadFile("sim_0.csv") + other.substr(0, other.find('\n') + 1));
  const CommandResult result = Local();
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_EQ(RefusedCount(json::parse(result.output), "sim_0",
                         "REFUSAL_REASON_CLOCK_EPOCH_WITHOUT_OFFSET"),
            1u);
}

TEST_F(LocalCommandFiles, EmptyFileIsNamedWithItsCamera) {
  WriteFile("sim_2.csv", "");
  const CommandResult result = Local();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("sim_2.csv"), HasSubstr("the file holds no line")));
  const json calibration = json::parse(result.output);
  EXPECT_EQ(calibration["state"], "STATE_FAILED");
  EXPECT_EQ(RefusedCount(calibration, "sim_2", "REFUSAL_REASON_CSV_EMPTY"), 1u);
}

TEST_F(LocalCommandFiles, CameraWithoutOverlapNamesTheGroups) {
  // Camera 2 sees the wand only in a time in which nobody else does, and in other places: those of
  // its rows, last to first.
  std::vector<std::string> times, rows;
  std::istringstream lines(ReadFile("sim_2.csv"));
  for (std::string line; std::getline(lines, line);) {
    const size_t separator = line.find(';');
    times.push_back(std::to_string(std::stoll(line.substr(0, separator)) + 100'000'000'000));
    rows.push_back(line.substr(separator));
  }
  std::string shifted;
  for (size_t i = 0; i < times.size(); ++i) shifted += times[i] + rows[rows.size() - 1 - i] + "\n";
  WriteFile("sim_2.csv", shifted);
  const CommandResult result = Local();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output + result.error,
              AllOf(HasSubstr("sim_0"), HasSubstr("sim_1"), HasSubstr("sim_2")));
}

TEST_F(LocalCommandFiles, MissingIntrinsicsAreNamed) {
  fs::remove(data() / "sim_1.yaml");
  const CommandResult result = Local();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("sim_1.yaml"));
}

TEST_F(LocalCommandFiles, MalformedIntrinsicsAreNamed) {
  WriteFile("sim_1.yaml", "%YAML:1.0\ncamera_matrix: [[[\n");
  const CommandResult result = Local();
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, HasSubstr("sim_1.yaml"));
}

TEST_F(LocalCommandFiles, WandOfOneMarkerIsRefused) {
  const CommandResult result = Local({}, "wand:0,0");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.error, HasSubstr("wand:0,0"));
}

TEST_F(LocalCommandFiles, FolderWithoutRecordingIsRefused) {
  for (const auto& entry : fs::directory_iterator(data())) fs::remove(entry.path());
  const CommandResult result = Local();
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.error, AllOf(HasSubstr(".csv"), HasSubstr(data().string())));
}

TEST_F(LocalCommandFiles, InterruptedLeavesNothingRunning) {
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    Process process(
        {{"rigcal", "local", "--data", data().string(), "--target", kTarget, "--speed", "0.5"},
         {}});
    // The agents carry the folder in their command lines: ourselves and three of them.
    ASSERT_TRUE(WaitFor([&] { return ProcessesWith(data().string()).size() >= 4; }))
        << process.StandardError();
    process.Signal(signal);
    EXPECT_NE(process.Wait(), 0);
    EXPECT_TRUE(WaitFor([&] { return ProcessesWith(data().string()).empty(); })) << signal;
  }
}

TEST_F(LocalCommandFiles, SeveralAtOnceDoNotDisturbEachOther) {
  const Process::Options options{
      {"rigcal", "local", "--data", data().string(), "--target", kTarget, "-o", "json"}, {}};
  Process first(options);
  Process second(options);
  EXPECT_EQ(first.Wait(), 0) << first.StandardError();
  EXPECT_EQ(second.Wait(), 0) << second.StandardError();
  EXPECT_EQ(WithoutIdentity(json::parse(first.StandardOutput())),
            WithoutIdentity(json::parse(second.StandardOutput())));
}

}  // namespace
}  // namespace rigcal::testing::local_command_test
