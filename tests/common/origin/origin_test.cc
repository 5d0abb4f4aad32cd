// SPDX-License-Identifier: Apache-2.0
#include "common/origin/origin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "tests/testing/status_matchers.h"

namespace rigcal {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

constexpr auto kRefused = absl::StatusCode::kFailedPrecondition;

// The room has z up; the rig frame is turned and shifted against it.
RigidTransform RigFromRoom() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(2.0, Eigen::Vector3d(1, 2, -0.5).normalized())),
          Eigen::Vector3d(0.3, -0.2, 4)};
}

// Four cameras at these heights above the floor.
CalibrationResult Cameras(const std::vector<double>& heights_m) {
  CalibrationResult calibration;
  calibration.scale_known = true;
  for (size_t i = 0; i < heights_m.size(); ++i) {
    CalibratedCamera camera;
    camera.camera = "cam" + std::to_string(i);
    const Eigen::Vector3d in_room(i % 2 == 0 ? 3 : -3, i < 2 ? 2 : -2, heights_m[i]);
    camera.cam_from_rig.translation_m = -(RigFromRoom() * in_room);
    calibration.cameras.push_back(camera);
  }
  return calibration;
}

CalibrationResult Ceiling() { return Cameras({2, 2.2, 2.4, 1.9}); }

// Points of the room as the rig measures them.
std::vector<OriginPoint> Measured(const std::vector<Eigen::Vector3d>& in_room) {
  std::vector<OriginPoint> points;
  for (size_t i = 0; i < in_room.size(); ++i) {
    points.push_back({"p" + std::to_string(i), RigFromRoom() * in_room[i],
                      1e-8 * Eigen::Matrix3d::Identity(), Eigen::Matrix3Xd(3, 0), 0});
  }
  return points;
}

TEST(FloorOrigin, PutsTheFloorUnderTheCameras) {
  const std::vector<Eigen::Vector3d> floor = {
      {1, 0, 0.02}, {1.4, 0, 0.02}, {-1, 1, 0.02}, {-1, 1.4, 0.02}, {0, -1, 0.02}};
  const auto solution = FloorOrigin(Ceiling(), Measured(floor), 0, 1, 0.02, {});
  ASSERT_THAT(solution, IsOk());
  const RigidTransform new_from_room = solution->change.new_from_rig * RigFromRoom();
  // The origin is below the first point, x towards the second, which is the room's x.
  EXPECT_NEAR((new_from_room.translation_m - Eigen::Vector3d(-1, 0, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR(new_from_room.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0, 1e-9);
  EXPECT_NEAR(solution->rms_m, 0, 1e-9);
  EXPECT_NEAR(solution->lowest_camera_m, 1.9, 1e-9);
  // A tenth of a millimetre over about a metre.
  EXPECT_GT(solution->rotation_sigma_rad.x(), 2e-5);
  EXPECT_LT(solution->rotation_sigma_rad.x(), 4e-4);
}

TEST(FloorOrigin, RefusesPointsOnOneLine) {
  const auto points = Measured({{0, 0, 0}, {0.13, 0, 0}, {0.39, 0.001, 0}});
  EXPECT_THAT(FloorOrigin(Ceiling(), points, 0, 2, 0, {}),
              StatusIs(kRefused, AllOf(HasSubstr("on one line"), HasSubstr("mm across"))));
}

TEST(FloorOrigin, RefusesTwoPoints) {
  EXPECT_THAT(FloorOrigin(Ceiling(), Measured({{0, 0, 0}, {1, 0, 0}}), 0, 1, 0, {}),
              StatusIs(kRefused, HasSubstr("2 points on the floor: three")));
}

TEST(FloorOrigin, RefusesAPlaneThatHoldsTheCameras) {
  const auto points = Measured({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}});
  EXPECT_THAT(FloorOrigin(Cameras({0.02, 0.01, -0.03, 0}), points, 0, 1, 0, {}),
              StatusIs(kRefused, AllOf(HasSubstr("one plane"), HasSubstr("which side is up"))));
}

TEST(FloorOrigin, RefusesAPlaneBetweenTheCamerasAndNamesThem) {
  const auto points = Measured({{0, 0, 2}, {1, 0, 2}, {0, 1, 2}, {-1, -1, 2}});
  EXPECT_THAT(FloorOrigin(Cameras({1, 3, 1, 3}), points, 0, 1, 0, {}),
              StatusIs(kRefused, AllOf(HasSubstr("cam0 (1.00 m)"), HasSubstr("cam1 (1.00 m)"))));
}

TEST(FloorOrigin, RefusesAPointBesideTheFloorAndNamesIt) {
  const auto points =
      Measured({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, -1, 0}, {1, 1, 0}, {0.1, 0.1, 0.05}});
  EXPECT_THAT(FloorOrigin(Ceiling(), points, 0, 1, 0, {}),
              StatusIs(kRefused, AllOf(HasSubstr("not on one plane"), HasSubstr("p5 is"))));
}

TEST(FloorOrigin, RefusesWhatIsTooWeak) {
  auto points = Measured({{0, 0, 0}, {0.3, 0, 0}, {0, 0.05, 0}});
  for (OriginPoint& point : points) point.noise_m2 = 1e-6 * Eigen::Matrix3d::Identity();
  EXPECT_THAT(FloorOrigin(Ceiling(), points, 0, 1, 0, {}),
              StatusIs(kRefused, AllOf(HasSubstr("weakly"), HasSubstr("degrees"))));
}

// As an L-frame stands in the room.
std::vector<Eigen::Vector3d> LFrame() {
  return {{0, 0, 0.02}, {0.6, 0, 0.02}, {0, 0.4, 0.02}, {0.2, 0, 0.02}};
}

TEST(PointOrigin, FindsTheFrameOfTheGivenPoints) {
  const auto solution = PointOrigin(Ceiling(), Measured(LFrame()), LFrame(), {});
  ASSERT_THAT(solution, IsOk());
  const RigidTransform new_from_room = solution->change.new_from_rig * RigFromRoom();
  EXPECT_NEAR(new_from_room.translation_m.norm(), 0, 1e-9);
  EXPECT_NEAR(solution->rms_m, 0, 1e-9);
}

TEST(PointOrigin, TheSigmasOfTheGivenPointsCount) {
  auto points = Measured(LFrame());
  const auto exact = PointOrigin(Ceiling(), points, LFrame(), {});
  for (OriginPoint& point : points) point.sigma_m = 0.001;
  const auto measured = PointOrigin(Ceiling(), points, LFrame(), {});
  ASSERT_THAT(exact, IsOk());
  ASSERT_THAT(measured, IsOk());
  EXPECT_GT(measured->rotation_sigma_rad.z(), 5 * exact->rotation_sigma_rad.z());
}

TEST(PointOrigin, RefusesTheMirrorImageOfABody) {
  const std::vector<Eigen::Vector3d> body = {
      {0, 0, 0}, {0.6, 0, 0}, {0, 0.4, 0}, {0, 0, 0.5}, {0.2, 0.3, 0.1}};
  std::vector<Eigen::Vector3d> given = body;
  for (Eigen::Vector3d& point : given) std::swap(point.y(), point.z());
  EXPECT_THAT(PointOrigin(Ceiling(), Measured(body), given, {}),
              StatusIs(kRefused, AllOf(HasSubstr("mirrored"), HasSubstr("mm"))));
}

TEST(PointOrigin, RefusesTheMirrorImageOfAFlatFrameByItsCameras) {
  std::vector<Eigen::Vector3d> given = LFrame();
  for (Eigen::Vector3d& point : given) std::swap(point.x(), point.y());
  EXPECT_THAT(PointOrigin(Ceiling(), Measured(LFrame()), given, {}),
              StatusIs(kRefused, AllOf(HasSubstr("camera cam2"), HasSubstr("mirrored"))));
  OriginOptions below;
  below.cameras_above = false;
  EXPECT_THAT(PointOrigin(Ceiling(), Measured(LFrame()), given, below), IsOk());
}

TEST(PointOrigin, RefusesGivenPointsOnOneLine) {
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {0.2, 0, 0}, {0.5, 0, 0}};
  EXPECT_THAT(PointOrigin(Ceiling(), Measured(line), line, {}),
              StatusIs(kRefused, HasSubstr("on one line")));
}

TEST(PointOrigin, NamesThePointThatDoesNotFit) {
  std::vector<Eigen::Vector3d> given = LFrame();
  given[1].x() += 0.05;
  EXPECT_THAT(PointOrigin(Ceiling(), Measured(LFrame()), given, {}),
              StatusIs(kRefused, AllOf(HasSubstr("do not fit"), HasSubstr("mm off"))));
}

TEST(LevelOrigin, TurnsZAgainstGravity) {
  const Eigen::Vector3d down = RigFromRoom().rotation * Eigen::Vector3d(0, 0, -9.81);
  const auto solution = LevelOrigin(Ceiling(), down);
  ASSERT_THAT(solution, IsOk());
  const Eigen::Vector3d up =
      solution->change.new_from_rig.rotation * (RigFromRoom().rotation * Eigen::Vector3d::UnitZ());
  EXPECT_NEAR((up - Eigen::Vector3d::UnitZ()).norm(), 0, 1e-9);
  EXPECT_THAT(LevelOrigin(Ceiling(), Eigen::Vector3d::Zero()),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no length")));
}

}  // namespace
}  // namespace rigcal
