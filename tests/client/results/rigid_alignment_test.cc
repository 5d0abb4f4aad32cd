// SPDX-License-Identifier: Apache-2.0
#include "client/results/rigid_alignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::client::rigid_alignment_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::_;

constexpr double kDegree = std::numbers::pi / 180;

Eigen::Quaterniond About(const Eigen::Vector3d& axis, double angle_rad) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, axis.normalized()));
}

const RigidTransform kBFromA(About(Eigen::Vector3d(1, 2, -1), 2.1), Eigen::Vector3d(4, -3, 7));

// Frame a's pose of a camera at `centre_m`, and the same camera seen from frame b.
PosePair Camera(const Eigen::Vector3d& centre_m, const Eigen::Quaterniond& a_from_cam) {
  const RigidTransform cam_from_a = RigidTransform(a_from_cam, centre_m).Inverse();
  return {cam_from_a, cam_from_a * kBFromA.Inverse()};
}

std::vector<PosePair> Cameras(const std::vector<Eigen::Vector3d>& centres_m) {
  std::vector<PosePair> cameras;
  for (size_t i = 0; i < centres_m.size(); ++i) {
    const auto k = static_cast<double>(i);
    cameras.push_back(Camera(centres_m[i], About(Eigen::Vector3d(1, k, 0.3), 0.4 + k)));
  }
  return cameras;
}

void ExpectFound(const std::vector<PosePair>& cameras) {
  ASSERT_OK_AND_ASSIGN(const RigidTransform found, AlignRigidly(cameras));
  EXPECT_LT((found.Matrix() - kBFromA.Matrix()).norm(), 1e-9);
  for (const PosePair& camera : cameras) {
    const PoseDifference difference = DifferenceAfter(found, camera);
    EXPECT_LT(difference.position_m, 1e-9);
    EXPECT_LT(difference.rotation_deg, 1e-8);
  }
}

TEST(AlignRigidly, FindsAKnownMotion) {
  ExpectFound(Cameras({{0, 0, 0}, {3, 0, 0}, {0, 4, 0}, {1, 1, 2}}));
}

TEST(AlignRigidly, FindsItForCamerasInOnePlane) {
  ExpectFound(Cameras({{0, 0, 0}, {3, 0, 0}, {0, 4, 0}}));
}

TEST(AlignRigidly, FindsItForTwoCamerasByTheirOrientations) {
  ExpectFound(Cameras({{0, 0, 0}, {3, 0, 0}}));
}

TEST(AlignRigidly, FindsItForCamerasOnALine) {
  ExpectFound(Cameras({{0, 0, 0}, {1, 1, 0}, {4, 4, 0}, {-2, -2, 0}}));
}

TEST(AlignRigidly, FindsItForOneCameraOrSeveralAtOnePlace) {
  ExpectFound(Cameras({{1, 2, 3}}));
  ExpectFound(Cameras({{1, 2, 3}, {1, 2, 3}}));
}

TEST(AlignRigidly, DoesNotScale) {
  std::vector<PosePair> cameras = Cameras({{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}});
  for (PosePair& camera : cameras) {
    // A tenth larger in b, about the same centroid.
    const Eigen::Vector3d centre = camera.cam_from_b.SourceFromTargetTranslation();
    const Eigen::Vector3d middle = kBFromA.translation_m;
    const Eigen::Quaterniond rotation = camera.cam_from_b.rotation;
    camera.cam_from_b = {rotation, rotation * -(middle + 1.1 * (centre - middle))};
  }
  ASSERT_OK_AND_ASSIGN(const RigidTransform found, AlignRigidly(cameras));
  for (const PosePair& camera : cameras) {
    EXPECT_NEAR(DifferenceAfter(found, camera).position_m, 0.1, 1e-6);
    EXPECT_NEAR(DifferenceAfter(found, camera).rotation_deg, 0, 1e-5);
  }
}

TEST(AlignRigidly, NeverMirrors) {
  // b is a's mirror image; the best a rotation can do is not good, and still a rotation.
  std::vector<PosePair> cameras = Cameras({{2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {0, 0, 0}});
  for (PosePair& camera : cameras) {
    Eigen::Vector3d centre = camera.cam_from_a.SourceFromTargetTranslation();
    centre.x() = -centre.x();
    camera.cam_from_b = {camera.cam_from_a.rotation, camera.cam_from_a.rotation * -centre};
  }
  ASSERT_OK_AND_ASSIGN(const RigidTransform found, AlignRigidly(cameras));
  EXPECT_NEAR(found.rotation.toRotationMatrix().determinant(), 1, 1e-12);
}

TEST(AlignRigidly, ReportsTheCameraThatMoved) {
  std::vector<PosePair> cameras =
      Cameras({{0, 0, 0}, {5, 0, 0}, {0, 5, 0}, {0, 0, 5}, {5, 5, 5}, {-5, 2, 1}});
  // Turned in place by 2 degrees: its centre stays.
  const Eigen::Vector3d centre = cameras[2].cam_from_b.SourceFromTargetTranslation();
  const Eigen::Quaterniond turned =
      About(Eigen::Vector3d(0.3, 1, 0), 2 * kDegree) * cameras[2].cam_from_b.rotation;
  cameras[2].cam_from_b = {turned, turned * -centre};
  ASSERT_OK_AND_ASSIGN(const RigidTransform found, AlignRigidly(cameras));
  for (size_t i = 0; i < cameras.size(); ++i) {
    const PoseDifference difference = DifferenceAfter(found, cameras[i]);
    EXPECT_NEAR(difference.rotation_deg, i == 2 ? 2 : 0, 1e-4) << i;
    EXPECT_NEAR(difference.position_m, 0, 1e-5) << i;
  }
}

TEST(AlignRigidly, RefusesWhatIsNotFinite) {
  std::vector<PosePair> cameras = Cameras({{0, 0, 0}, {5, 0, 0}});
  cameras[1].cam_from_a.translation_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(AlignRigidly(cameras), StatusIs(absl::StatusCode::kInvalidArgument, _));
  EXPECT_THAT(AlignRigidly({}), StatusIs(absl::StatusCode::kInvalidArgument, _));
}

}  // namespace
}  // namespace rigcal::client::rigid_alignment_test
