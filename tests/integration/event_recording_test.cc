// SPDX-License-Identifier: Apache-2.0
// A recorded rig with markers of frame cameras and RAW files of event cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "agent/capture/pacer.h"
#include "agent/capture/simulated/simulated_event_source.h"
#include "agent/event/evt3_writer.h"
#include "common/geometry/rigid_transform.h"
#include "common/import/intrinsics_file.h"
#include "tests/testing/process.h"
#include "tests/testing/recorded_rig.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::event_recording_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::OptionsFrom;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::AllOf;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr char kWorld[] =
    "cameras=4;duration=9;rate=50;noise=0.05;outliers=0;offset.2=0.004;"
    "offset.3=0.004";
constexpr char kTarget[] = "wand:0,0.13,0.39;hz=500";

// Writes <camera>.raw and <camera>.yaml instead of the camera's markers.
void WriteEvents(int index, const fs::path& directory) {
  agent::SimulatedEventSourceOptions options;
  options.camera = "sim_" + std::to_string(index);
  options.camera_index = index;
  options.simulation = *ParseSimulationOptions(kWorld);
  options.rendering =
      *OptionsFrom<EventRenderOptions>("background=0.2;bars=1;lamps=1;hot_pixels=5;leak=0");
  options.speed = agent::kMaxSpeed;
  ASSERT_OK_AND_ASSIGN(const auto source, agent::SimulatedEventSource::Create(options));
  const CameraDescription& camera = source->description();
  CameraExport yaml;
  yaml.camera = camera.camera;
  yaml.image_size_px = camera.image_size_px;
  yaml.intrinsics = *camera.intrinsics;
  ASSERT_THAT(WriteCameraExport((directory / (camera.camera + ".yaml")).string(), yaml), IsOk());
  fs::remove(directory / (camera.camera + ".csv"));
  std::ofstream raw(directory / (camera.camera + ".raw"), std::ios::binary);
  raw << agent::Evt3Header({camera.image_size_px.width, camera.image_size_px.height}, "0001");
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget(kTarget));
  ASSERT_THAT(source->Start(target), IsOk());
  while (true) {
    ASSERT_OK_AND_ASSIGN(const auto chunk, source->Next());
    if (!chunk) break;
    raw.write(reinterpret_cast<const char*>(chunk->bytes.data()),
              static_cast<std::streamsize>(chunk->bytes.size()));
  }
}

class EventRecording : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = new TemporaryDirectory();
    WriteRecordedRig(*ParseSimulationOptions(kWorld), directory_->path());
    for (const int index : {2, 3}) WriteEvents(index, directory_->path());
  }
  static void TearDownTestSuite() { delete directory_; }

  static CommandResult Local(const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {"rigcal",   "local", "--data", directory_->path().string(),
                                        "--target", kTarget, "-o",     "json"};
    command.insert(command.end(), more.begin(), more.end());
    return RunCommand(command);
  }

  static TemporaryDirectory* directory_;
};
TemporaryDirectory* EventRecording::directory_ = nullptr;

RigidTransform Pose(const json& camera) {
  const json& rotation = camera["cam_from_rig"]["rotation"];
  const json& translation = camera["cam_from_rig"]["translation_m"];
  return {Eigen::Quaterniond(rotation["w"], rotation["x"], rotation["y"], rotation["z"]),
          Eigen::Vector3d(translation["x"], translation["y"], translation["z"])};
}

TEST_F(EventRecording, IsCalibratedTogetherWithMarkers) {
  const CommandResult result = Local({"--event-options", "clock=cable;rate=250"});
  ASSERT_EQ(result.exit_code, 0) << result.error << result.output;
  const json calibration = json::parse(result.output);
  ASSERT_EQ(calibration["cameras"].size(), 4u);
  ASSERT_OK_AND_ASSIGN(const Target target, ParseTarget(kTarget));
  ASSERT_OK_AND_ASSIGN(const SimulatedWorld world,
                       SimulatedWorld::Create(*ParseSimulationOptions(kWorld), target));
  const RigidTransform rig_from_first = world.cameras()[0].cam_from_rig.Inverse();
  for (size_t i = 1; i < 4; ++i) {
    const RigidTransform truth = world.cameras()[i].cam_from_rig * rig_from_first;
    const RigidTransform found = Pose(calibration["cameras"][i]);
    EXPECT_LE((found.Inverse().translation_m - truth.Inverse().translation_m).norm(), 0.005) << i;
    EXPECT_LE(found.rotation.angularDistance(truth.rotation), 0.001) << i;
  }
  const json& left = calibration["cameras"][2];
  const json& right = calibration["cameras"][3];
  EXPECT_EQ(left["clock_id"], "cable");
  EXPECT_EQ(left["time_offset_s"], right["time_offset_s"]);
  const double first_s = calibration["cameras"][0]["time_offset_s"];
  EXPECT_NEAR(left["time_offset_s"].get<double>() - first_s, 0.004, 3e-4);
  EXPECT_GE(left["residuals"]["observation_count"], 1000);
  EXPECT_GE(right["residuals"]["observation_count"], 1000);
}

TEST_F(EventRecording, GivesTheSameResultAsHdf5) {
  const CommandResult raw = Local();
  ASSERT_EQ(raw.exit_code, 0) << raw.error;
  const fs::path recording = directory_->path() / "sim_3.raw";
  const fs::path converted = directory_->path() / "sim_3.h5";
  const CommandResult convert =
      RunCommand({"rigcal-agent", "convert", recording.string(), converted.string()});
  ASSERT_EQ(convert.exit_code, 0) << convert.error;
  // Both files in one folder are two recordings of one camera.
  EXPECT_THAT(Local().error, HasSubstr("several recordings: sim_3.h5, sim_3.raw"));
  fs::rename(recording, directory_->path() / "away");
  const CommandResult hdf5 = Local();
  fs::rename(directory_->path() / "away", recording);
  fs::remove(converted);
  ASSERT_EQ(hdf5.exit_code, 0) << hdf5.error;
  EXPECT_EQ(json::parse(hdf5.output)["observation_digest"],
            json::parse(raw.output)["observation_digest"]);
}

TEST_F(EventRecording, WithoutItsCalibrationItIsNamed) {
  fs::rename(directory_->path() / "sim_3.yaml", directory_->path() / "away");
  const CommandResult result = Local();
  fs::rename(directory_->path() / "away", directory_->path() / "sim_3.yaml");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("sim_3.raw is there, but"), HasSubstr("sim_3.yaml")));
}

TEST_F(EventRecording, FileWithoutEventsIsNamed) {
  const fs::path raw = directory_->path() / "sim_3.raw";
  fs::rename(raw, directory_->path() / "away");
  std::ofstream(raw) << "no events\n";
  const CommandResult result = Local();
  fs::rename(directory_->path() / "away", raw);
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr("agent of camera sim_3"), HasSubstr("sim_3.raw")));
}

}  // namespace
}  // namespace rigcal::testing::event_recording_test
