// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/world/simulated_rig.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::simulated_rig_test {
namespace {

using ::rigcal::testing::IsOk;

SimulationOptions WithCameras(int count, uint32_t seed = 1) {
  SimulationOptions options;
  options.camera_count = count;
  options.seed = seed;
  return options;
}

Eigen::Vector3d Centre(const SimulatedCamera& camera) {
  return camera.cam_from_rig.SourceFromTargetTranslation();
}

TEST(SimulatedRig, EveryCameraHasANeighbourThreeToFiveMetresAwayAndNoneNearer) {
  for (const int count : {2, 3, 4, 5, 6, 7, 10, 11, 24, 50, 100}) {
    for (const uint32_t seed : {1u, 2u, 3u, 4u, 5u}) {
      const auto cameras = MakeSimulatedCameras(WithCameras(count, seed));
      ASSERT_EQ(cameras.size(), static_cast<size_t>(count));
      for (const SimulatedCamera& a : cameras) {
        double nearest_m = std::numeric_limits<double>::infinity();
        for (const SimulatedCamera& b : cameras) {
          if (&a != &b) nearest_m = std::min(nearest_m, (Centre(a) - Centre(b)).norm());
        }
        EXPECT_GE(nearest_m, 3) << count << " cameras, seed " << seed;
        EXPECT_LE(nearest_m, 5) << count << " cameras, seed " << seed;
      }
    }
  }
}

TEST(SimulatedRig, CamerasLookToTheMiddleTheRightWayUpFromDifferentHeights) {
  const SimulationOptions options = WithCameras(6);
  const auto cameras = MakeSimulatedCameras(options);
  double lowest = 100, highest = -100;
  for (const SimulatedCamera& camera : cameras) {
    const Eigen::Vector3d middle_in_cam = camera.cam_from_rig * MakeWaveVolume(options).centre_m;
    EXPECT_GT(middle_in_cam.z(), 2);
    EXPECT_LT(middle_in_cam.head<2>().norm(), 0.1 * middle_in_cam.z());
    // y of the camera points down: what is higher in the rig is higher in the image.
    EXPECT_LT((camera.cam_from_rig.rotation * Eigen::Vector3d::UnitZ()).y(), -0.8);
    EXPECT_NEAR(camera.cam_from_rig.rotation.norm(), 1, 1e-12);
    lowest = std::min(lowest, Centre(camera).z());
    highest = std::max(highest, Centre(camera).z());
  }
  EXPECT_GT(highest - lowest, 0.3);
}

TEST(SimulatedRig, CamerasAreValidAndHaveLensesOfTheirOwn) {
  const auto cameras = MakeSimulatedCameras(WithCameras(100));
  for (size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_THAT(cameras[i].description.Validate(), IsOk());
    EXPECT_EQ(cameras[i].description.camera, "sim_" + std::to_string(i));
    EXPECT_EQ(cameras[i].description.image_size_px, (ImageSize{1280, 1024}));
    if (i > 0) {
      EXPECT_NE(cameras[i].description.intrinsics, cameras[0].description.intrinsics);
    }
  }
}

TEST(SimulatedRig, ClocksFollowTheOptions) {
  SimulationOptions options = WithCameras(4);
  options.time_offset_s = {{1, 0.008}};
  options.time_rate_ppm = {{2, 50}};
  options.camera_rate_hz = {{3, 60}};
  auto cameras = MakeSimulatedCameras(options);
  EXPECT_EQ(cameras[1].time_offset_s, 0.008);
  EXPECT_EQ(cameras[0].time_offset_s, 0);
  EXPECT_EQ(cameras[2].time_rate_ppm, 50);
  EXPECT_EQ(cameras[3].rate_hz, 60);
  EXPECT_EQ(cameras[0].rate_hz, 25);
  for (const SimulatedCamera& camera : cameras) {
    EXPECT_EQ(camera.phase_s, 0);
    EXPECT_EQ(camera.clock_origin_ns, 10'000'000'000);
    EXPECT_EQ(camera.description.clock.timebase, "sim");
    EXPECT_EQ(camera.description.clock.clock_id, camera.description.camera);
  }
  options.free_running = true;
  options.clock_samples = true;
  cameras = MakeSimulatedCameras(options);
  for (size_t i = 0; i < cameras.size(); ++i) {
    EXPECT_GE(cameras[i].phase_s, 0);
    EXPECT_LT(cameras[i].phase_s, 1 / cameras[i].rate_hz);
    EXPECT_EQ(cameras[i].description.clock.timebase, "");
    for (size_t j = 0; j < i; ++j) {
      EXPECT_NE(cameras[i].phase_s, cameras[j].phase_s);
      EXPECT_GT(std::abs(cameras[i].clock_origin_ns - cameras[j].clock_origin_ns),
                int64_t{3600} * 1000000000);
    }
  }
}

}  // namespace
}  // namespace rigcal::simulated_rig_test
