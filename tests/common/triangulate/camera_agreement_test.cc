// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/camera_agreement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::camera_agreement_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::RowsOf;
using testing::StatusIs;
using testing::TrueResult;

SimulatedWorld World() { return testing::WavedWorld(6); }

absl::Status Check(const CalibrationResult& calibration, const std::vector<CameraRows>& rows) {
  const auto triangulation = TriangulateRows(calibration, rows, {});
  EXPECT_THAT(triangulation, testing::IsOk());
  return CheckCamerasAgree(calibration, *triangulation);
}

TEST(CheckCamerasAgree, AcceptsARigAsItWasCalibrated) {
  const SimulatedWorld world = World();
  EXPECT_THAT(Check(TrueResult(world), RowsOf(world)), testing::IsOk());
}

TEST(CheckCamerasAgree, NamesTheCameraThatWasTurned) {
  const SimulatedWorld world = World();
  CalibrationResult calibration = TrueResult(world);
  CalibratedCamera& turned = calibration.cameras[2];
  turned.cam_from_rig =
      RigidTransform(Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX())),
                     Eigen::Vector3d::Zero()) *
      turned.cam_from_rig;
  EXPECT_THAT(Check(calibration, RowsOf(world)),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("sim_2 ("), HasSubstr("--only sim_2)"),
                             Not(HasSubstr("sim_0")), Not(HasSubstr("sim_1")))));
}

TEST(CheckCamerasAgree, SaysThatNoTwoAgree) {
  const SimulatedWorld world = World();
  std::vector<CameraRows> rows = RowsOf(world);
  std::swap(rows[1].rows, rows[3].rows);
  EXPECT_THAT(Check(TrueResult(world), rows),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("Calibrate anew")));
}

// A few bad centres are what leaving out is for, and too few tell nothing of their camera.
TEST(CheckCamerasAgree, AllowsACameraWithSomeBadCentres) {
  const SimulatedWorld world = World();
  for (const size_t every : {3, 1}) {
    std::vector<CameraRows> rows = RowsOf(world);
    if (every == 1) rows[0].rows.resize(6);
    for (size_t i = 0; i < rows[0].rows.size(); i += every) {
      for (MarkerObservation& marker : rows[0].rows[i].markers) marker.centre_px.x() += 40;
    }
    EXPECT_THAT(Check(TrueResult(world), rows), testing::IsOk()) << every;
  }
}

}  // namespace
}  // namespace rigcal::camera_agreement_test
