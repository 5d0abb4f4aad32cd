// SPDX-License-Identifier: Apache-2.0
#include "client/local/local_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::local_plan_test {
namespace {

namespace fs = std::filesystem;
using ::rigcal::testing::ParseSimulationOptions;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

RecordedFolder Folder(const fs::path& path) {
  RecordedFolder folder;
  folder.path = path;
  folder.cameras = {{"left", path / "left.csv"}, {"right", path / "right.csv"}};
  return folder;
}

TEST(PlanRecorded, OneAgentPerCameraNamedInFront) {
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanRecorded(Folder("/my rig/a=b"), "2.5", {}, "/run"));
  ASSERT_EQ(plan.cameras.size(), 2u);
  EXPECT_EQ(plan.cameras[0].name, "left");
  EXPECT_EQ(plan.cameras[0].source, "left=csv:/my rig/a=b/left.csv;speed=2.5");
  EXPECT_EQ(plan.cameras[1].source, "right=csv:/my rig/a=b/right.csv;speed=2.5");
  EXPECT_FALSE(plan.world.has_value());
}

TEST(PlanRecorded, ASeparatorInThePathIsReachedThroughALink) {
  const rigcal::testing::TemporaryDirectory directory;
  directory.WriteFile("rig;speed=3/left.csv", "1;2");
  const fs::path run = directory.path() / "run";
  fs::create_directory(run);
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanRecorded(Folder(directory.path() / "rig;speed=3"), "max", {}, run));
  const std::string link = (run / "recording" / "left.csv").string();
  EXPECT_EQ(plan.cameras[0].source, "left=csv:" + link + ";speed=max");
  EXPECT_TRUE(fs::exists(link));
}

TEST(PlanRecorded, WithoutAWayRoundTheSeparatorItIsRefused) {
  EXPECT_THAT(PlanRecorded(Folder("/a;b"), "max", {}, "/c;d"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("';'")));
}

TEST(PlanRecorded, EventsAreReadAsAsked) {
  RecordedFolder folder = Folder("/rig");
  folder.cameras[1].recording = "/rig/right.raw";
  folder.cameras[1].kind = RecordingKind::kEvents;
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanRecorded(folder, "max", {.events = "rate=500;clock=cable"}, "/run"));
  EXPECT_EQ(plan.cameras[0].source, "left=csv:/rig/left.csv;speed=max");
  EXPECT_EQ(plan.cameras[1].source, "right=raw:/rig/right.raw;speed=max;rate=500;clock=cable");
  EXPECT_THAT(PlanRecorded(Folder("/rig"), "max", {.events = "rate=500"}, "/run"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("rate=500")));
}

TEST(PlanRecorded, ImagesAndVideosAreReadAsAsked) {
  RecordedFolder folder = Folder("/rig");
  folder.cameras[0] = {"left", "/rig/left", RecordingKind::kImages};
  folder.cameras[1] = {"right", "/rig/right.mkv", RecordingKind::kVideo};
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanRecorded(folder, "max", {.frames = "fps=25"}, "/run"));
  EXPECT_EQ(plan.cameras[0].source, "left=images:/rig/left;speed=max;fps=25");
  EXPECT_EQ(plan.cameras[1].source, "right=video:/rig/right.mkv;speed=max;fps=25");
  EXPECT_THAT(PlanRecorded(Folder("/rig"), "max", {.frames = "fps=25"}, "/run"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("images and videos")));
}

TEST(PlanSimulated, GivesEveryAgentTheSameWorld) {
  ASSERT_OK_AND_ASSIGN(const SimulationOptions options,
                       ParseSimulationOptions("cameras=3;seed=9;offset.2=0.008;wand_speed=2"));
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanSimulated({.world = options, .frames = std::nullopt}, target, "max"));
  ASSERT_TRUE(plan.world.has_value());
  ASSERT_EQ(plan.cameras.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    const std::string name = "sim_" + std::to_string(i);
    EXPECT_EQ(plan.cameras[i].name, name);
    EXPECT_EQ(plan.world->cameras()[i].description.camera, name);
    EXPECT_EQ(plan.cameras[i].source, name + "=sim:camera=" + std::to_string(i) + ";" +
                                          FormatSimulationOptions(options) + ";speed=max");
  }
}

TEST(PlanSimulated, TakesLensesFromAFolder) {
  const TemporaryDirectory folder;
  ASSERT_OK_AND_ASSIGN(const SimulationOptions options, ParseSimulationOptions("cameras=2"));
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  const SimulatedRigOptions rig = {.world = options, .frames = std::nullopt};
  std::ofstream(folder.path() / "sim_0.yaml") << "a lens";
  EXPECT_THAT(PlanSimulated(rig, target, "max", folder.path().string()),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("sim_1.yaml")));
  std::ofstream(folder.path() / "sim_1.yaml") << "a lens";
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan,
                       PlanSimulated(rig, target, "max", folder.path().string()));
  EXPECT_THAT(plan.cameras[1].source,
              HasSubstr(";calibration=" + (folder.path() / "sim_1.yaml").string()));
}

TEST(PlanSimulated, EventCamerasAreTheLastOnesAndHaveTheirOwnOptions) {
  ASSERT_OK_AND_ASSIGN(
      const SimulatedRigOptions rig,
      ParseSimulatedRigOptions("cameras=3;duration=2;rate=50;pixels=1;lux=300;events=1;"
                               "background=2;output=500;event_clock=cable"));
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget("wand:0,0.13,0.39"));
  ASSERT_OK_AND_ASSIGN(const LocalPlan plan, PlanSimulated(rig, target, "max"));
  ASSERT_EQ(plan.cameras.size(), 3u);
  EXPECT_THAT(plan.cameras[1].source, AllOf(HasSubstr(";pixels=1;lux=300"),
                                            Not(HasSubstr("background")), Not(HasSubstr("clock"))));
  EXPECT_THAT(plan.cameras[2].source,
              HasSubstr(";events=1;lux=300;background=2;output=500;clock=cable;speed=max"));
  EXPECT_EQ(plan.duration_s, 2);
  EXPECT_EQ(plan.cameras[1].expected_count, 100u);
  EXPECT_EQ(plan.cameras[2].expected_count, 1000u);
}

}  // namespace
}  // namespace rigcal::client::local_plan_test
