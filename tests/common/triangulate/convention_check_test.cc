// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/convention_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal {
namespace {

using ::testing::HasSubstr;
using testing::RowsOf;
using testing::StatusIs;
using testing::TrueResult;

SimulatedWorld World() { return testing::WavedWorld(6); }

absl::Status Check(const CalibrationResult& calibration, const std::vector<CameraRows>& rows) {
  const auto triangulation = TriangulateRows(calibration, rows, {});
  EXPECT_THAT(triangulation, testing::IsOk());
  return CheckConvention(calibration, rows, {}, *triangulation);
}

TEST(CheckConvention, AcceptsWhatFits) {
  const SimulatedWorld world = World();
  EXPECT_THAT(Check(TrueResult(world), RowsOf(world)), testing::IsOk());
}

TEST(CheckConvention, NamesInvertedPoses) {
  const SimulatedWorld world = World();
  CalibrationResult calibration = TrueResult(world);
  for (CalibratedCamera& camera : calibration.cameras) {
    camera.cam_from_rig = camera.cam_from_rig.Inverse();
  }
  EXPECT_THAT(Check(calibration, RowsOf(world)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("as rig_from_cam")));
}

TEST(CheckConvention, NamesTheAxesOfOpenGl) {
  const SimulatedWorld world = World();
  CalibrationResult calibration = TrueResult(world);
  for (CalibratedCamera& camera : calibration.cameras) {
    camera.cam_from_rig = RigidTransform(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero()) *
                          camera.cam_from_rig;
  }
  EXPECT_THAT(Check(calibration, RowsOf(world)),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("look along -z, y up")));
}

TEST(CheckConvention, SaysThatRowsOfAnotherRigDoNotFit) {
  const SimulatedWorld world = World();
  std::vector<CameraRows> rows = RowsOf(world);
  std::swap(rows[0].rows, rows[1].rows);
  std::swap(rows[2].rows, rows[3].rows);
  EXPECT_THAT(Check(TrueResult(world), rows),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("do not fit")));
}

}  // namespace
}  // namespace rigcal
