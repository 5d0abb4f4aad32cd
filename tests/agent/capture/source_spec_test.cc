// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_spec.h"

#include <limits>
#include <string>

#include "tests/agent/capture/camera_yaml.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ParseSourceSpec, FillsInWhatACsvSourceLeavesOut) {
  ASSERT_OK_AND_ASSIGN(const SourceSpec spec, ParseSourceSpec("csv:/data/a.b/frame_0.csv"));
  const auto& csv = std::get<CsvSourceOptions>(spec);
  EXPECT_EQ(csv.camera, "frame_0");
  EXPECT_EQ(csv.path, "/data/a.b/frame_0.csv");
  EXPECT_EQ(csv.calibration_path, "/data/a.b/frame_0.yaml");
  EXPECT_EQ(csv.speed, 1);
  EXPECT_EQ(csv.sigma_px, 0.5);
}

TEST(ParseSourceSpec, TakesEveryPartOfACsvSource) {
  ASSERT_OK_AND_ASSIGN(
      const SourceSpec spec,
      ParseSourceSpec("left=csv:x=1/f.csv;speed=max;sigma=0.25;calibration=c/left.yml"));
  const auto& csv = std::get<CsvSourceOptions>(spec);
  EXPECT_EQ(CameraNameOf(spec), "left");
  EXPECT_EQ(csv.path, "x=1/f.csv");
  EXPECT_EQ(csv.calibration_path, "c/left.yml");
  EXPECT_EQ(csv.speed, kMaxSpeed);
  EXPECT_EQ(csv.sigma_px, 0.25);
}

TEST(ParseSourceSpec, KeepsAnEqualsSignOfAPathWithoutName) {
  ASSERT_OK_AND_ASSIGN(const SourceSpec spec, ParseSourceSpec("csv:run=3/cam.csv"));
  EXPECT_EQ(std::get<CsvSourceOptions>(spec).path, "run=3/cam.csv");
  EXPECT_EQ(CameraNameOf(spec), "cam");
}

TEST(ParseSourceSpec, TakesEveryPartOfASimulatedSource) {
  ASSERT_OK_AND_ASSIGN(const SourceSpec spec,
                       ParseSourceSpec("top=sim:camera=3;seed=7;cameras=8;wand_speed=1.25;"
                                       "offset.2=0.008;speed=10"));
  const auto& sim = std::get<SimulatedSourceOptions>(spec);
  EXPECT_EQ(sim.camera, "top");
  EXPECT_EQ(sim.camera_index, 3);
  EXPECT_EQ(sim.speed, 10);
  EXPECT_EQ(sim.simulation.seed, 7u);
  EXPECT_EQ(sim.simulation.camera_count, 8);
  EXPECT_EQ(sim.simulation.max_speed_m_s, 1.25);
  EXPECT_EQ(sim.simulation.time_offset_s.at(2), 0.008);
  ASSERT_OK_AND_ASSIGN(const SourceSpec shortest, ParseSourceSpec("sim:camera=2"));
  EXPECT_EQ(CameraNameOf(shortest), "sim_2");
}

struct BadSpec {
  const char* text;
  const char* what;
};

class BadSpecTest : public ::testing::TestWithParam<BadSpec> {};

TEST_P(BadSpecTest, IsRefusedWithThePartAndAnExample) {
  EXPECT_THAT(ParseSourceSpec(GetParam().text),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr(GetParam().what), HasSubstr("example: "))));
}

INSTANTIATE_TEST_SUITE_P(
    All, BadSpecTest,
    ::testing::Values(
        BadSpec{"", "begins with neither csv: nor sim:"},
        BadSpec{"frame_0.csv", "begins with neither csv: nor sim:"},
        BadSpec{"left=frame_0.csv", "\"frame_0.csv\" begins with neither"},
        BadSpec{"=csv:a.csv", "no name before '='"}, BadSpec{"csv:", "no path behind csv:"},
        BadSpec{"csv:;speed=1", "no path behind csv:"},
        BadSpec{"csv:a.csv;speed=fast", "speed=fast"}, BadSpec{"csv:a.csv;speed=0", "speed=0"},
        BadSpec{"csv:a.csv;speed=-1", "speed=-1"}, BadSpec{"csv:a.csv;speed=nan", "speed=nan"},
        BadSpec{"csv:a.csv;speed=inf", "speed=inf"}, BadSpec{"csv:a.csv;sigma=0", "sigma=0"},
        BadSpec{"csv:a.csv;sigma=nan", "sigma=nan"}, BadSpec{"csv:a.csv;sigma", "\"sigma\""},
        BadSpec{"csv:a.csv;calibration=", "\"calibration=\""},
        BadSpec{"csv:a.csv;", "part \"\" is not KEY=VALUE"},
        BadSpec{"csv:a.csv;gamma=2", "\"gamma\" is not known"},
        BadSpec{"csv:a.csv;speed=1;speed=2", "speed is given twice"},
        BadSpec{"csv:\xff.csv", "not UTF-8"}, BadSpec{"csv:/data/my camera.csv", "camera name"},
        BadSpec{"a/b=csv:a.csv", "camera name"}, BadSpec{"sim:", "no camera=INDEX"},
        BadSpec{"sim:camera=x", "camera=x"}, BadSpec{"sim:camera=-1", "camera=-1"},
        BadSpec{"sim:camera=0;colour=red", "colour"}, BadSpec{"sim:camera=0;noise=much", "noise"}));

TEST(ParseSourceSpec, LetsTheKeysOfAConfigurationGoBeforeItsSource) {
  CameraConfig camera;
  camera.source = "csv:rig/f.csv;speed=2";
  camera.name = "left";
  camera.calibration = "rig/other.yaml";
  camera.speed = std::numeric_limits<double>::infinity();
  camera.sigma_px = 0.75;
  ASSERT_OK_AND_ASSIGN(const SourceSpec spec, ParseSourceSpec(camera));
  const auto& csv = std::get<CsvSourceOptions>(spec);
  EXPECT_EQ(csv.camera, "left");
  EXPECT_EQ(csv.calibration_path, "rig/other.yaml");
  EXPECT_EQ(csv.speed, kMaxSpeed);
  EXPECT_EQ(csv.sigma_px, 0.75);
}

TEST(ParseSourceSpec, NamesTheLineOfTheConfiguration) {
  CameraConfig camera;
  camera.where = "agent.toml:12";
  camera.source = "csv:f.csv;speed=soon";
  EXPECT_THAT(ParseSourceSpec(camera),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(StartsWith("agent.toml:12: "), HasSubstr("speed=soon"))));
  camera.source = "sim:camera=0";
  camera.sigma_px = 0.5;
  EXPECT_THAT(ParseSourceSpec(camera),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("neither sigma")));
}

TEST(CreateSource, MakesEachKind) {
  const TemporaryDirectory directory;
  const std::string path = directory.WriteFile("left.csv", "1;2;3\n").string();
  directory.WriteFile("left.yaml", kCameraYaml);
  ASSERT_OK_AND_ASSIGN(const SourceSpec csv, ParseSourceSpec("csv:" + path));
  ASSERT_OK_AND_ASSIGN(const auto csv_source, CreateSource(csv));
  EXPECT_EQ(csv_source->description().camera, "left");
  ASSERT_OK_AND_ASSIGN(const SourceSpec sim, ParseSourceSpec("sim:camera=1"));
  ASSERT_OK_AND_ASSIGN(const auto sim_source, CreateSource(sim));
  EXPECT_EQ(sim_source->description().camera, "sim_1");
}

TEST(CreateSource, SaysWhichCameraHasNoFile) {
  ASSERT_OK_AND_ASSIGN(const SourceSpec spec, ParseSourceSpec("left=csv:/nowhere/f.csv"));
  EXPECT_THAT(CreateSource(spec),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("/nowhere/f.csv"))));
}

}  // namespace
}  // namespace rigcal::agent
