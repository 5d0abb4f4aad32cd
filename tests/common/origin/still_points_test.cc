// SPDX-License-Identifier: Apache-2.0
#include "common/origin/still_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;
using testing::TrueResult;

SimulatedWorld World() { return testing::WavedWorld(4); }

// A wave, a rest, a wave, another rest, and the first place again.
std::vector<CameraRows> WavesAndRests(const SimulatedWorld& world,
                                      const std::vector<WandPose>& places) {
  std::vector<CameraRows> rows;
  for (int c = 0; c < static_cast<int>(world.cameras().size()); ++c) {
    CameraRows& camera = rows.emplace_back();
    camera.camera = world.cameras()[static_cast<size_t>(c)].description.camera;
    int frame = 0;
    for (const WandPose& place : places) {
      for (int i = 0; i < 25; ++i, ++frame) {
        camera.rows.push_back(world.ObserveWand(c, frame, world.WandAt(frame / 25.0)));
      }
      for (int i = 0; i < 25; ++i, ++frame) {
        camera.rows.push_back(world.ObserveWand(c, frame, place));
      }
    }
  }
  return rows;
}

TEST(FindStillPoints, FindsThePlacesAndJoinsThoseThatComeAgain) {
  const SimulatedWorld world = World();
  const WandPose a{Eigen::Vector3d(0.2, 0.1, 0.9), Eigen::Vector3d::UnitX()};
  const WandPose b{Eigen::Vector3d(-0.5, 0.3, 0.9), Eigen::Vector3d::UnitY()};
  StillOptions options;
  options.triangulation.sigma_px = 0.3;
  const auto still = FindStillPoints(TrueResult(world), WavesAndRests(world, {a, b, a}), options);
  ASSERT_THAT(still, testing::IsOk());
  ASSERT_EQ(still->size(), 6u);
  for (const StillPoint& point : *still) {
    const WandPose& pose = point.place == 0 ? a : b;
    const double error_m =
        (point.position_m - world.MarkerAt(pose, static_cast<size_t>(point.marker))).norm();
    EXPECT_LT(error_m, 4 * std::sqrt(point.noise_m2.trace()));
    EXPECT_LT(error_m, 0.001);
  }
}

TEST(FindStillPoints, SaysHowLongTheTargetRestedAtMost) {
  const SimulatedWorld world = World();
  EXPECT_THAT(FindStillPoints(TrueResult(world), testing::RowsOf(world), {}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("the longest rest is")));
}

}  // namespace
}  // namespace rigcal
