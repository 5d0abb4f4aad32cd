// SPDX-License-Identifier: Apache-2.0
// Four simulated cameras with rendered pixels, each seen through the detector of its own agent,
// calibrated by a real server, against ground truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <iostream>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulated_world.h"
#include "common/wire/camera_wire.h"
#include "tests/testing/process.h"
#include "tests/testing/server_client.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::pixel_calibration_test {
namespace {

using ::rigcal::testing::ParseSimulationOptions;

constexpr int kCameras = 4;
constexpr char kTarget[] = "wand:0,0.13,0.39;diameter=0.04;hz=500";
constexpr char kWorld[] = "seed=1;cameras=4;duration=40;rate=10";

// Calibrates the rig of this world; `more` is appended to each source.
absl::StatusOr<v1::Calibration> CalibrateFromPixels(const std::string& more) {
  const TemporaryDirectory directory;
  ServerProcess server(directory.path() / "store");
  std::vector<std::unique_ptr<Process>> agents;
  for (int i = 0; i < kCameras; ++i) {
    agents.push_back(std::make_unique<Process>(Process::Options{
        {"rigcal-agent", "--server", server.address(), "--state-dir",
         (directory.path() / ("agent" + std::to_string(i))).string(), "--source",
         "sim:camera=" + std::to_string(i) + ";pixels=1;speed=max;" + kWorld + more},
        {}}));
  }
  ServerClient client(server.address());
  if (!WaitFor([&] {
        const auto listed = client.ListAgents();
        return listed.ok() && listed->size() == size_t{kCameras};
      })) {
    return absl::DeadlineExceededError(agents[0]->StandardError());
  }
  v1::CreateSessionRequest request;
  request.set_id("wave");
  *request.mutable_target() = wire::ToProto(*ParseTarget(kTarget));
  if (const auto created = client.CreateSession(request); !created.ok()) return created.status();
  if (const auto started = client.StartSession("wave"); !started.ok()) return started.status();
  const auto finished = client.WaitUntilFinished("wave");
  if (!finished.ok()) return finished.status();
  EXPECT_EQ(finished->observation_count(), 1600u);
  return client.Calibrate("wave");
}

// cam_from_first of each camera, where the first one is sim_0.
std::map<std::string, RigidTransform> PosesInFirst(const v1::Calibration& calibration) {
  std::map<std::string, RigidTransform> poses;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    poses[camera.camera()] = *wire::FromProto(camera.cam_from_rig());
  }
  const RigidTransform rig_from_first = poses.at("sim_0").Inverse();
  for (auto& [name, pose] : poses) pose = pose * rig_from_first;
  return poses;
}

std::map<std::string, double> Offsets(const v1::Calibration& calibration) {
  std::map<std::string, double> offsets_s;
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    offsets_s[camera.camera()] = camera.time_offset_s();
  }
  return offsets_s;
}

TEST(PixelCalibration, FindsTheRigToAMillimetre) {
  const auto calibration = CalibrateFromPixels("");
  ASSERT_THAT(calibration, IsOk());
  ASSERT_EQ(calibration->state(), v1::Calibration::STATE_SUCCEEDED) << calibration->error();
  ASSERT_EQ(calibration->cameras_size(), kCameras);
  ASSERT_OK_AND_ASSIGN(const SimulationOptions options, ParseSimulationOptions(kWorld));
  ASSERT_OK_AND_ASSIGN(const SimulatedWorld world,
                       SimulatedWorld::Create(options, *ParseTarget(kTarget)));
  const auto poses = PosesInFirst(*calibration);
  const RigidTransform rig_from_first = world.cameras()[0].cam_from_rig.Inverse();
  for (const SimulatedCamera& camera : world.cameras()) {
    const RigidTransform truth = camera.cam_from_rig * rig_from_first;
    const RigidTransform& found = poses.at(camera.description.camera);
    const double position_m =
        (truth.Inverse().translation_m - found.Inverse().translation_m).norm();
    const double rotation_deg =
        truth.rotation.angularDistance(found.rotation) * 180 / std::numbers::pi;
    // The requirements for rendered pixels.
    EXPECT_LE(position_m, 0.001) << camera.description.camera;
    EXPECT_LE(rotation_deg, 0.03) << camera.description.camera;
    std::cout << camera.description.camera << ": " << position_m * 1e3 << " mm, " << rotation_deg
              << " deg\n";
  }
}

TEST(PixelCalibration, FindsTheOffsetsPutIntoTwoCameras) {
  const auto without = CalibrateFromPixels("");
  const auto with = CalibrateFromPixels(";offset.1=0.004;offset.3=-0.007");
  ASSERT_THAT(without, IsOk());
  ASSERT_THAT(with, IsOk());
  ASSERT_EQ(with->state(), v1::Calibration::STATE_SUCCEEDED) << with->error();
  std::map<std::string, double> offsets_s = Offsets(*with);
  for (const auto& [camera, offset_s] : Offsets(*without)) offsets_s[camera] -= offset_s;
  const std::map<std::string, double> put_in_s = {
      {"sim_0", 0}, {"sim_1", 0.004}, {"sim_2", 0}, {"sim_3", -0.007}};
  // Offsets are relative to the median clock, which is no single camera here: compare differences.
  for (const auto& [camera, offset_s] : put_in_s) {
    EXPECT_NEAR(offsets_s.at(camera) - offsets_s.at("sim_0"), offset_s, 0.0002) << camera;
  }
}

}  // namespace
}  // namespace rigcal::testing::pixel_calibration_test
