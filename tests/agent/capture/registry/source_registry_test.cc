// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/registry/source_registry.h"

#include <fstream>
#include <memory>
#include <regex>
#include <sstream>
#include <string>

#include "agent/capture/frame_source_spec.h"
#include "agent/capture/genicam/aravis_options.h"
#include "agent/capture/pacer.h"
#include "agent/capture/recorded/csv_observation_source.h"
#include "agent/capture/recorded/recorded_frame_source.h"
#include "agent/capture/registry/source_help.h"
#include "agent/capture/simulated/simulated_frame_source.h"
#include "agent/capture/simulated/simulated_observation_source.h"
#include "tests/agent/capture/camera_yaml.h"
#include "tests/agent/capture/source_options_of.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::source_registry_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ParseSourceSpec, FillsInWhatACsvSourceLeavesOut) {
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec("csv:/data/a.b/frame_0.csv"));
  const auto& csv = OptionsOf<CsvSourceOptions>(*spec);
  EXPECT_EQ(csv.camera, "frame_0");
  EXPECT_EQ(csv.path, "/data/a.b/frame_0.csv");
  EXPECT_EQ(csv.calibration_path, "/data/a.b/frame_0.yaml");
  EXPECT_EQ(csv.speed, 1);
  EXPECT_EQ(csv.sigma_px, 0.5);
}

TEST(ParseSourceSpec, TakesEveryPartOfACsvSource) {
  ASSERT_OK_AND_ASSIGN(
      const auto spec,
      ParseSourceSpec("left=csv:x=1/f.csv;speed=max;sigma=0.25;calibration=c/left.yml;"
                      "centres=sphere"));
  const auto& csv = OptionsOf<CsvSourceOptions>(*spec);
  EXPECT_EQ(spec->camera(), "left");
  EXPECT_EQ(csv.path, "x=1/f.csv");
  EXPECT_EQ(csv.calibration_path, "c/left.yml");
  EXPECT_EQ(csv.centre_kind, CentreKind::kSphereCentre);
  EXPECT_EQ(csv.speed, kMaxSpeed);
  EXPECT_EQ(csv.sigma_px, 0.25);
}

TEST(ParseSourceSpec, KeepsAnEqualsSignOfAPathWithoutName) {
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec("csv:run=3/cam.csv"));
  EXPECT_EQ(OptionsOf<CsvSourceOptions>(*spec).path, "run=3/cam.csv");
  EXPECT_EQ(spec->camera(), "cam");
}

TEST(ParseSourceSpec, TakesEveryPartOfASimulatedSource) {
  ASSERT_OK_AND_ASSIGN(const auto spec,
                       ParseSourceSpec("top=sim:camera=3;seed=7;cameras=8;wand_speed=1.25;"
                                       "offset.2=0.008;speed=10"));
  const auto& sim = OptionsOf<SimulatedCameraOptions>(*spec);
  EXPECT_EQ(sim.camera, "top");
  EXPECT_EQ(sim.camera_index, 3);
  EXPECT_EQ(sim.speed, 10);
  EXPECT_EQ(sim.simulation.seed, 7u);
  EXPECT_EQ(sim.simulation.camera_count, 8);
  EXPECT_EQ(sim.simulation.max_speed_m_s, 1.25);
  EXPECT_EQ(sim.simulation.time_offset_s.at(2), 0.008);
  ASSERT_OK_AND_ASSIGN(const auto shortest, ParseSourceSpec("sim:camera=2"));
  EXPECT_EQ(shortest->camera(), "sim_2");
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
        BadSpec{"", "begins with none of csv:, images:"},
        BadSpec{"frame_0.csv", "begins with none of csv:, images:"},
        BadSpec{"left=frame_0.csv", "\"frame_0.csv\" begins with none of"},
        BadSpec{"=csv:a.csv", "no name before '='"}, BadSpec{"csv:", "no path behind csv:"},
        BadSpec{"csv:;speed=1", "no path behind csv:"},
        BadSpec{"csv:a.csv;speed=fast", "speed=fast"}, BadSpec{"csv:a.csv;speed=0", "speed=0"},
        BadSpec{"csv:a.csv;speed=-1", "speed=-1"}, BadSpec{"csv:a.csv;speed=nan", "speed=nan"},
        BadSpec{"csv:a.csv;speed=inf", "speed=inf"}, BadSpec{"csv:a.csv;sigma=0", "sigma=0"},
        BadSpec{"csv:a.csv;sigma=nan", "sigma=nan"}, BadSpec{"csv:a.csv;sigma", "\"sigma\""},
        BadSpec{"csv:a.csv;calibration=", "\"calibration=\""},
        BadSpec{"csv:a.csv;", "\"\" is not KEY=VALUE"},
        BadSpec{"csv:a.csv;centres=round", "centres=round"},
        BadSpec{"csv:a.csv;gamma=2",
                "unknown option \"gamma\"; known: speed, calibration, sigma, centres"},
        BadSpec{"csv:a.csv;speed=1;speed=2", "speed is given twice"},
        BadSpec{"csv:\xff.csv", "not UTF-8"}, BadSpec{"csv:/data/my camera.csv", "camera name"},
        BadSpec{"a/b=csv:a.csv", "camera name"}, BadSpec{"sim:", "the option camera is missing"},
        BadSpec{"sim:camera=x", "camera=x"}, BadSpec{"sim:camera=-1", "camera=-1"},
        BadSpec{"sim:camera=0;colour=red", "colour"}, BadSpec{"sim:camera=0;noise=much", "noise"},
        BadSpec{"images:", "no path behind images:"}, BadSpec{"video:", "no path behind video:"},
        BadSpec{"images:a;fps=0", "fps=0"}, BadSpec{"images:a;exposure=-1", "exposure=-1"},
        BadSpec{"images:a;tracking=maybe", "tracking=maybe"},
        BadSpec{"images:a;value_min=0", "value_min=0"},
        BadSpec{"images:a;value_min=1.5", "value_min=1.5"},
        BadSpec{"images:a;hue_min=nan", "hue_min=nan"},
        BadSpec{"images:a;sigma=1", "unknown option \"sigma\""},
        BadSpec{"sim:camera=0;lux=10", "lux"}, BadSpec{"sim:camera=0;pixels=2", "pixels=2"},
        BadSpec{"sim:camera=0;pixels=1;fps=3", "fps"}, BadSpec{"aravis:", "device"},
        BadSpec{"aravis:1.2.3.4;gain=loud", "gain=loud must be a number of -60 to 100 dB"},
        BadSpec{"a=csv:x;fpss=3", "unknown option \"fpss\""},
        BadSpec{"images:a;fpss=3", "unknown option \"fpss\"; did you mean \"fps\"?"},
        BadSpec{"images:a;fpss=3;tracking=maybe;hue_min=400", "hue_min=400 must be"},
        BadSpec{"image:a", "did you mean \"images:\"?"},
        BadSpec{"sim:camera=0;pixels=1;cluter=2", "did you mean \"clutter\"?"}));

TEST(ParseSourceSpec, TakesEveryPartOfFramesInFiles) {
  ASSERT_OK_AND_ASSIGN(
      const auto spec,
      ParseSourceSpec("l=images:rig/left/;timestamps=t.csv;fps=30;exposure=0.005;speed=2;"
                      "calibration=none;hue_min=340;hue_max=40;saturation_min=0.2;value_min=70;"
                      "washed_out_min=256;min_area=4;max_area=900;max_blobs=64;min_distance=1;"
                      "max_distance=9;max_tilt=70;min_confidence=0.55;tracking=0;mask=m.png;"
                      "learn_mask=2;background=5"));
  const auto& frames = dynamic_cast<const FrameSourceSpec&>(*spec);
  const auto& images = OptionsOf<RecordedFramesOptions>(*spec);
  EXPECT_EQ(spec->camera(), "l");
  EXPECT_EQ(images.path, "rig/left/");
  EXPECT_EQ(images.calibration_path, "");
  EXPECT_EQ(images.timestamps_path, "t.csv");
  EXPECT_EQ(images.fps, 30);
  EXPECT_EQ(images.exposure_s, 0.005);
  EXPECT_EQ(images.speed, 2);
  const WandDetectorOptions& detector = frames.detecting.detector;
  EXPECT_EQ(detector.colour, (ColourRange{340, 40, 0.2, 70, 256}));
  EXPECT_EQ(detector.min_area_px, 4);
  EXPECT_EQ(detector.max_area_px, 900);
  EXPECT_EQ(detector.max_blobs, 64);
  EXPECT_EQ(detector.min_distance_m, 1);
  EXPECT_EQ(detector.max_distance_m, 9);
  EXPECT_EQ(detector.max_tilt_deg, 70);
  EXPECT_EQ(detector.min_confidence, 0.55);
  EXPECT_FALSE(detector.tracking);
  EXPECT_EQ(frames.detecting.mask_path, "m.png");
  EXPECT_EQ(frames.detecting.learn_mask_s, 2);
  EXPECT_EQ(frames.detecting.background_s, 5);
}

TEST(ParseSourceSpec, FillsInWhatFilesOfFramesLeaveOut) {
  ASSERT_OK_AND_ASSIGN(const auto folder, ParseSourceSpec("images:rig/left/"));
  EXPECT_EQ(folder->camera(), "left");
  const auto& images = OptionsOf<RecordedFramesOptions>(*folder);
  EXPECT_EQ(images.calibration_path, "rig/left.yaml");
  EXPECT_EQ(images.speed, 1);
  ASSERT_OK_AND_ASSIGN(const auto film, ParseSourceSpec("video:rig/right.mkv"));
  EXPECT_EQ(film->camera(), "right");
  EXPECT_EQ(OptionsOf<RecordedFramesOptions>(*film).calibration_path, "rig/right.yaml");
}

TEST(ParseSourceSpec, TellsTheWorldsPartsFromTheFrames) {
  ASSERT_OK_AND_ASSIGN(
      const auto spec,
      ParseSourceSpec("sim:camera=1;pixels=1;seed=7;cameras=4;lux=50;exposure=0.004;"
                      "wand_speed=2;clutter=0.5;offset.1=0.003;hue_max=45;"
                      "speed=max"));
  const auto& frames = dynamic_cast<const FrameSourceSpec&>(*spec);
  const auto& sim = OptionsOf<SimulatedFrameSourceOptions>(*spec);
  EXPECT_EQ(sim.camera, "sim_1");
  EXPECT_EQ(sim.camera_index, 1);
  EXPECT_EQ(sim.speed, kMaxSpeed);
  EXPECT_EQ(sim.simulation.seed, 7u);
  EXPECT_EQ(sim.rendering.seed, 7u);
  EXPECT_EQ(sim.simulation.camera_count, 4);
  EXPECT_EQ(sim.simulation.max_speed_m_s, 2);
  EXPECT_EQ(sim.simulation.time_offset_s.at(1), 0.003);
  EXPECT_EQ(sim.rendering.lux, 50);
  EXPECT_EQ(sim.rendering.exposure_s, 0.004);
  EXPECT_EQ(sim.rendering.clutter, 0.5);
  EXPECT_EQ(frames.detecting.detector.colour.hue_max_deg, 45);
  ASSERT_OK_AND_ASSIGN(const auto without, ParseSourceSpec("sim:camera=1;pixels=0"));
  EXPECT_EQ(OptionsOf<SimulatedCameraOptions>(*without).camera_index, 1);
}

TEST(ParseSourceSpec, TakesEveryPartOfAGenicamCamera) {
  ASSERT_OK_AND_ASSIGN(
      const auto spec,
      ParseSourceSpec("aravis:192.168.1.5;calibration=l.yaml;pixel_format=BayerRG8;exposure=0.004;"
                      "gain=6;frame_rate=50;trigger=software;ptp=1;latency=0.001;buffers=8;"
                      "packet_size=1440;packet_resend=0;socket_buffer=100000;interface=eth1;"
                      "tracking=false"));
  const auto& frames = dynamic_cast<const FrameSourceSpec&>(*spec);
  const auto& aravis = OptionsOf<AravisSourceOptions>(*spec);
  EXPECT_EQ(aravis.camera, "192.168.1.5");
  EXPECT_EQ(aravis.device, "192.168.1.5");
  EXPECT_EQ(aravis.calibration_path, "l.yaml");
  EXPECT_EQ(aravis.pixel_format, "BayerRG8");
  EXPECT_EQ(aravis.exposure_s, 0.004);
  EXPECT_EQ(aravis.gain_db, 6.0);
  EXPECT_EQ(aravis.frame_rate_hz, 50.0);
  EXPECT_EQ(aravis.trigger, "software");
  EXPECT_TRUE(aravis.ptp);
  EXPECT_EQ(aravis.latency_s, 0.001);
  EXPECT_EQ(aravis.buffer_count, 8);
  EXPECT_EQ(aravis.packet_size, 1440);
  EXPECT_FALSE(aravis.packet_resend);
  EXPECT_EQ(aravis.socket_buffer_bytes, 100000);
  EXPECT_EQ(aravis.network_interface, "eth1");
  EXPECT_FALSE(frames.detecting.detector.tracking);
}

TEST(ParseSourceSpec, NamesEveryFaultOfTheTablesWithItsLine) {
  CameraConfig camera;
  camera.where = "agent.toml:12";
  camera.source = "images:left";
  camera.options = {{"hue_min", "red", "agent.toml:15"},
                    {"exposure", "99", "agent.toml:16"},
                    {"colour", "1", "agent.toml:17"}};
  EXPECT_THAT(ParseSourceSpec(camera),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("agent.toml:15: hue_min=red"),
                             HasSubstr("agent.toml:16: exposure=99"),
                             HasSubstr("agent.toml:17: unknown option \"colour\""))));
}

TEST(ParseSourceSpec, KeysOfAConfigurationOverrideItsSource) {
  CameraConfig camera;
  camera.source = "csv:f.csv;speed=2";
  camera.name = "left";
  camera.folder = "/data/rig";
  camera.options = {{"calibration", "other.yaml", "agent.toml:3"},
                    {"speed", "max", "agent.toml:4"},
                    {"sigma", "0.75", "agent.toml:5"}};
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec(camera));
  const auto& csv = OptionsOf<CsvSourceOptions>(*spec);
  EXPECT_EQ(csv.camera, "left");
  EXPECT_EQ(csv.path, "/data/rig/f.csv");
  EXPECT_EQ(csv.calibration_path, "/data/rig/other.yaml");
  EXPECT_EQ(csv.speed, kMaxSpeed);
  EXPECT_EQ(csv.sigma_px, 0.75);
}

TEST(ParseSourceSpec, PathsOfAConfigurationAreRelativeToItsFolder) {
  CameraConfig camera;
  camera.source = "images:/data/left;timestamps=typed.csv";
  camera.folder = "/rig";
  camera.options = {{"calibration", "none", "agent.toml:3"}, {"mask", "m.png", "agent.toml:4"}};
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec(camera));
  const auto& images = OptionsOf<RecordedFramesOptions>(*spec);
  EXPECT_EQ(images.path, "/data/left");
  EXPECT_EQ(images.calibration_path, "");
  EXPECT_EQ(images.timestamps_path, "typed.csv") << "relative to where it is typed";
  EXPECT_EQ(dynamic_cast<const FrameSourceSpec&>(*spec).detecting.mask_path, "/rig/m.png");
}

TEST(ParseSourceSpec, NamesTheLineOfTheConfiguration) {
  CameraConfig camera;
  camera.where = "agent.toml:12";
  camera.source = "csv:f.csv;speed=soon";
  EXPECT_THAT(ParseSourceSpec(camera),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(StartsWith("agent.toml:12: "), HasSubstr("speed=soon"))));
  camera.source = "sim:camera=0";
  camera.options = {{"sigma", "0.5", "agent.toml:14"}};
  EXPECT_THAT(ParseSourceSpec(camera),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(StartsWith("agent.toml:12: "),
                             HasSubstr("agent.toml:14: unknown option \"sigma\""))));
}

// deploy/agent.toml shows defaults behind a '#': a key that no longer exists must not stay there.
TEST(ParseSourceSpec, KnowsEveryKeyOfTheSampleConfiguration) {
  std::ifstream stream(std::string(RIGCAL_SOURCE_DIR) + "/deploy/agent.toml");
  std::string text;
  int uncommented = 0;
  for (std::string line; std::getline(stream, line);) {
    static const std::regex kDefault(R"(^#([a-z_]+ = |\[).*)");
    if (std::regex_match(line, kDefault)) {
      line.erase(0, 1);
      ++uncommented;
    }
    text += line + "\n";
  }
  EXPECT_GT(uncommented, 25);
  const TemporaryDirectory directory;
  ASSERT_OK_AND_ASSIGN(const AgentConfig config,
                       ReadAgentConfig(directory.WriteFile("agent.toml", text).string()));
  ASSERT_EQ(config.cameras.size(), 3u);
  for (const CameraConfig& camera : config.cameras) EXPECT_THAT(ParseSourceSpec(camera), IsOk());
}

TEST(SourceKinds, HaveExamplesThatAreRead) {
  for (const SourceKind* kind : SourceKinds()) {
    EXPECT_THAT(ParseSourceSpec(kind->example), IsOk()) << kind->example;
    EXPECT_TRUE(IsSourceText(kind->example));
    EXPECT_THAT(SourceSummaries(), HasSubstr(std::string(kind->summary)));
  }
  EXPECT_FALSE(IsSourceText("rig/left.csv"));
  EXPECT_FALSE(IsSourceText("csv"));
}

TEST(SourceKinds, EveryOptionHasHelpAndADefaultThatIsRead) {
  for (const SourceKind* kind : SourceKinds()) {
    const auto spec = kind->make();
    OptionTable table;
    spec->AddTo(&table);
    for (const OptionHelp& option : table.Help()) {
      EXPECT_NE(option.meaning, "") << kind->name << " " << option.name;
      EXPECT_NE(option.values, "") << kind->name << " " << option.name;
      if (option.default_value.empty()) continue;
      FaultList faults;
      EXPECT_TRUE(table.ReadOne({.key = option.name, .value = option.default_value}, &faults));
      EXPECT_THAT(faults.Result(), IsOk()) << kind->name;
    }
  }
}

TEST(SourceKinds, HelpListsEveryOptionOfAKind) {
  ASSERT_OK_AND_ASSIGN(const std::string images, SourceOptionsHelp("images"));
  EXPECT_THAT(images, AllOf(HasSubstr("images:FOLDER"), HasSubstr("fps"), HasSubstr("hue_min")));
  ASSERT_OK_AND_ASSIGN(const std::string sim, SourceOptionsHelp("sim"));
  EXPECT_THAT(sim, AllOf(HasSubstr("pixels=1"), HasSubstr("events=1"), HasSubstr("offset.N")));
  EXPECT_THAT(SourceOptionsHelp("imags"),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("did you mean \"images\"?")));
}

TEST(SourceKinds, AreDocumentedAsTheyAre) {
  std::ifstream stream(std::string(RIGCAL_SOURCE_DIR) + "/docs/sources.md");
  std::stringstream page;
  page << stream.rdbuf();
  EXPECT_EQ(page.str(), SourcesMarkdown())
      << "write it anew: rigcal-agent sources --markdown > docs/sources.md";
}

TEST(CreateSource, MakesEachKind) {
  const TemporaryDirectory directory;
  const std::string path = directory.WriteFile("left.csv", "1;2;3\n").string();
  directory.WriteFile("left.yaml", kCameraYaml);
  ASSERT_OK_AND_ASSIGN(const auto csv, ParseSourceSpec("csv:" + path));
  ASSERT_OK_AND_ASSIGN(const auto csv_source, csv->Create());
  EXPECT_EQ(csv_source->description().camera, "left");
  ASSERT_OK_AND_ASSIGN(const auto sim, ParseSourceSpec("sim:camera=1"));
  ASSERT_OK_AND_ASSIGN(const auto sim_source, sim->Create());
  EXPECT_EQ(sim_source->description().camera, "sim_1");
}

TEST(CreateSource, SaysWhichCameraHasNoFile) {
  ASSERT_OK_AND_ASSIGN(const auto spec, ParseSourceSpec("left=csv:/nowhere/f.csv"));
  EXPECT_THAT(spec->Create(),
              StatusIs(absl::StatusCode::kNotFound,
                       AllOf(HasSubstr("camera left"), HasSubstr("/nowhere/f.csv"))));
}

}  // namespace
}  // namespace rigcal::agent::source_registry_test
