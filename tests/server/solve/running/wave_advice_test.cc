// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/wave_advice.h"

#include <gtest/gtest.h>

namespace rigcal::server::wave_advice_test {
namespace {

// A camera that stands at `centre`, upright in a rig whose z is up, and looks to the middle.
BundleCamera CameraAt(const std::string& name, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d z = (-centre).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d cam_from_rig;
  cam_from_rig << x.transpose(), z.cross(x).transpose(), z.transpose();
  BundleCamera camera;
  camera.name = name;
  camera.cam_from_rig = {Eigen::Quaterniond(cam_from_rig), -(cam_from_rig * centre)};
  return camera;
}

class DescribePlaceTest : public ::testing::Test {
 protected:
  DescribePlaceTest() {
    grid_.origin_m = {-1, -1, -1};
    grid_.step_m = 0.25;
    grid_.counts = {9, 9, 9};
  }
  std::string At(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const {
    return DescribePlace(cameras_, grid_, point, direction, EstimateUp(cameras_));
  }

  const std::vector<BundleCamera> cameras_ = {
      CameraAt("east", {4, 0, 0}), CameraAt("north", {0, 4, 0}), CameraAt("west", {-4, 0, 0}),
      CameraAt("south", {0, -4, 0})};
  WavedGrid grid_;
};

TEST_F(DescribePlaceTest, UpIsWhereTheImagesHaveTheirTop) {
  EXPECT_NEAR((EstimateUp(cameras_) - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-9);
}

TEST_F(DescribePlaceTest, SaysHeightPlaceAndTheWand) {
  EXPECT_EQ(At({0, 0, 0}, {0, 0, 1}), "at mid height, in the middle, wand upright");
  EXPECT_EQ(At({0.9, 0, -0.9}, {1, 0, 0}), "low, towards east, wand level");
  EXPECT_EQ(At({0.7, 0.7, 0.9}, {0, 0, -1}), "high, between east and north, wand upright");
  EXPECT_EQ(At({-0.7, -0.6, 0}, Eigen::Vector3d(1, 0, 1).normalized()),
            "at mid height, between south and west, wand tilted");
}

}  // namespace
}  // namespace rigcal::server::wave_advice_test
