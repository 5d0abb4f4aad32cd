// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_spec.h"

#include <fstream>
#include <limits>
#include <regex>
#include <string>

#include "tests/agent/capture/camera_yaml.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::source_spec_test {
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
      ParseSourceSpec("left=csv:x=1/f.csv;speed=max;sigma=0.25;calibration=c/left.yml;"
                      "centres=sphere"));
  const auto& csv = std::get<CsvSourceOptions>(spec);
  EXPECT_EQ(CameraNameOf(spec), "left");
  EXPECT_EQ(csv.path, "x=1/f.csv");
  EXPECT_EQ(csv.calibration_path, "c/left.yml");
  EXPECT_EQ(csv.centre_kind, CentreKind::kSphereCentre);
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
        BadSpec{"", "begins with none of csv:, sim:"},
        BadSpec{"frame_0.csv", "begins with none of csv:, sim:"},
        BadSpec{"left=frame_0.csv", "\"frame_0.csv\" begins with none of"},
        BadSpec{"=csv:a.csv", "no name before '='"}, BadSpec{"csv:", "no path behind csv:"},
        BadSpec{"csv:;speed=1", "no path behind csv:"},
        BadSpec{"csv:a.csv;speed=fast", "speed=fast"}, BadSpec{"csv:a.csv;speed=0", "speed=0"},
        BadSpec{"csv:a.csv;speed=-1", "speed=-1"}, BadSpec{"csv:a.csv;speed=nan", "speed=nan"},
        BadSpec{"csv:a.csv;speed=inf", "speed=inf"}, BadSpec{"csv:a.csv;sigma=0", "sigma=0"},
        BadSpec{"csv:a.csv;sigma=nan", "sigma=nan"}, BadSpec{"csv:a.csv;sigma", "\"sigma\""},
        BadSpec{"csv:a.csv;calibration=", "\"calibration=\""},
        BadSpec{"csv:a.csv;", "part \"\" is not KEY=VALUE"},
        BadSpec{"csv:a.csv;centres=round", "centres=round"},
        BadSpec{"csv:a.csv;gamma=2", "\"gamma\" is not known"},
        BadSpec{"csv:a.csv;speed=1;speed=2", "speed is given twice"},
        BadSpec{"csv:\xff.csv", "not UTF-8"}, BadSpec{"csv:/data/my camera.csv", "camera name"},
        BadSpec{"a/b=csv:a.csv", "camera name"}, BadSpec{"sim:", "no camera=INDEX"},
        BadSpec{"sim:camera=x", "camera=x"}, BadSpec{"sim:camera=-1", "camera=-1"},
        BadSpec{"sim:camera=0;colour=red", "colour"}, BadSpec{"sim:camera=0;noise=much", "noise"},
        BadSpec{"images:", "no path behind images:"}, BadSpec{"video:", "no path behind video:"},
        BadSpec{"images:a;fps=0", "fps=0"}, BadSpec{"images:a;exposure=-1", "exposure=-1"},
        BadSpec{"images:a;tracking=maybe", "tracking=maybe"},
        BadSpec{"images:a;value_min=0", "value_min=0"},
        BadSpec{"images:a;value_min=1.5", "value_min=1.5"},
        BadSpec{"images:a;hue_min=nan", "hue_min=nan"},
        BadSpec{"images:a;sigma=1", "\"sigma\" is not known"},
        BadSpec{"sim:camera=0;lux=10", "lux"}, BadSpec{"sim:camera=0;pixels=2", "pixels=2"},
        BadSpec{"sim:camera=0;pixels=1;fps=3", "fps"}, BadSpec{"aravis:", "device"},
        BadSpec{"aravis:1.2.3.4;gain=loud", "gain=loud"}));

TEST(ParseSourceSpec, TakesEveryPartOfPicturesInFiles) {
  ASSERT_OK_AND_ASSIGN(
      const SourceSpec spec,
      ParseSourceSpec("l=images:rig/left/;timestamps=t.csv;fps=30;exposure=0.005;speed=2;"
                      "calibration=none;hue_min=340;hue_max=40;saturation_min=0.2;value_min=70;"
                      "washed_out_min=256;min_area=4;max_area=900;max_blobs=64;min_distance=1;"
                      "max_distance=9;max_tilt=70;min_confidence=0.6;tracking=0;mask=m.png;"
                      "learn_mask=2"));
  const auto& pictures = std::get<FrameSourceSpec>(spec);
  const auto& images = std::get<ImagesSourceOptions>(pictures.frames);
  EXPECT_EQ(CameraNameOf(spec), "l");
  EXPECT_EQ(images.path, "rig/left/");
  EXPECT_EQ(images.calibration_path, "");
  EXPECT_EQ(images.timestamps_path, "t.csv");
  EXPECT_EQ(images.fps, 30);
  EXPECT_EQ(images.exposure_s, 0.005);
  EXPECT_EQ(images.speed, 2);
  const WandDetectorOptions& detector = pictures.detecting.detector;
  EXPECT_EQ(detector.colour, (ColourRange{340, 40, 0.2, 70, 256}));
  EXPECT_EQ(detector.min_area_px, 4);
  EXPECT_EQ(detector.max_area_px, 900);
  EXPECT_EQ(detector.max_blobs, 64);
  EXPECT_EQ(detector.min_distance_m, 1);
  EXPECT_EQ(detector.max_distance_m, 9);
  EXPECT_EQ(detector.max_tilt_deg, 70);
  EXPECT_EQ(detector.min_confidence, 0.6);
  EXPECT_FALSE(detector.tracking);
  EXPECT_EQ(pictures.detecting.mask_path, "m.png");
  EXPECT_EQ(pictures.detecting.learn_mask_s, 2);
}

TEST(ParseSourceSpec, FillsInWhatFilesOfPicturesLeaveOut) {
  ASSERT_OK_AND_ASSIGN(const SourceSpec folder, ParseSourceSpec("images:rig/left/"));
  EXPECT_EQ(CameraNameOf(folder), "left");
  const auto& images = std::get<ImagesSourceOptions>(std::get<FrameSourceSpec>(folder).frames);
  EXPECT_EQ(images.calibration_path, "rig/left.yaml");
  EXPECT_EQ(images.speed, 1);
  ASSERT_OK_AND_ASSIGN(const SourceSpec film, ParseSourceSpec("video:rig/right.mkv"));
  EXPECT_EQ(CameraNameOf(film), "right");
  EXPECT_EQ(std::get<VideoSourceOptions>(std::get<FrameSourceSpec>(film).frames).calibration_path,
            "rig/right.yaml");
}

TEST(ParseSourceSpec, TellsTheWorldsPartsFromThePictures) {
  ASSERT_OK_AND_ASSIGN(
      const SourceSpec spec,
      ParseSourceSpec("sim:camera=1;pixels=1;seed=7;cameras=4;lux=50;exposure=0.004;"
                      "wand_speed=2;clutter=0.5;offset.1=0.003;hue_max=45;"
                      "speed=max"));
  const auto& pictures = std::get<FrameSourceSpec>(spec);
  const auto& sim = std::get<SimulatedFrameSourceOptions>(pictures.frames);
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
  EXPECT_EQ(pictures.detecting.detector.colour.hue_max_deg, 45);
  ASSERT_OK_AND_ASSIGN(const SourceSpec without, ParseSourceSpec("sim:camera=1;pixels=0"));
  EXPECT_TRUE(std::holds_alternative<SimulatedSourceOptions>(without));
}

TEST(ParseSourceSpec, TakesEveryPartOfAGenicamCamera) {
  ASSERT_OK_AND_ASSIGN(
      const SourceSpec spec,
      ParseSourceSpec("aravis:192.168.1.5;calibration=l.yaml;pixel_format=BayerRG8;exposure=0.004;"
                      "gain=6;frame_rate=50;trigger=software;ptp=1;latency=0.001;buffers=8;"
                      "packet_size=1440;packet_resend=0;socket_buffer=100000;interface=eth1;"
                      "tracking=false"));
  const auto& pictures = std::get<FrameSourceSpec>(spec);
  const auto& aravis = std::get<AravisSourceOptions>(pictures.frames);
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
  EXPECT_FALSE(pictures.detecting.detector.tracking);
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
                             HasSubstr("agent.toml:17: part \"colour\" is not known"))));
}

TEST(ParseSourceSpec, KnowsTheKindsThatTheConfigurationKnows) {
  for (const SourceKindName& kind : kSourceKindNames) {
    const absl::StatusOr<SourceSpec> spec = ParseSourceSpec(std::string(kind.prefix));
    EXPECT_THAT(std::string(spec.status().message()),
                ::testing::Not(HasSubstr("begins with none of")))
        << kind.prefix;
  }
}

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
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(StartsWith("agent.toml:12: "), HasSubstr("sigma=0.5"))));
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
}  // namespace rigcal::agent::source_spec_test
