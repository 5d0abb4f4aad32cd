// SPDX-License-Identifier: Apache-2.0
#include "common/triangulate/camera_agreement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
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

TEST(CheckCamerasAgree, NamesTwoCamerasWhoseRowsAreEachOthers) {
  const SimulatedWorld world = World();
  for (size_t a = 0; a < 4; ++a) {
    for (size_t b = a + 1; b < 4; ++b) {
      std::vector<CameraRows> rows = RowsOf(world);
      std::swap(rows[a].rows, rows[b].rows);
      const std::string question =
          absl::StrCat("are the files of sim_", a, " and sim_", b, " exchanged");
      EXPECT_THAT(Check(TrueResult(world), rows),
                  StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(question)));
      // A part of the rows: most of each camera's are right.
      rows = RowsOf(world);
      const size_t count = rows[a].rows.size() / 5;
      for (size_t i = 0; i < count; ++i) {
        std::swap(rows[a].rows[i].markers, rows[b].rows[i].markers);
      }
      EXPECT_THAT(Check(TrueResult(world), rows),
                  StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(question)));
      // So few that no share says anything.
      rows = RowsOf(world, 0, 0.16);
      ASSERT_LE(rows[a].rows.size(), 4u);
      std::swap(rows[a].rows, rows[b].rows);
      EXPECT_THAT(Check(TrueResult(world), rows),
                  StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr(question)));
    }
  }
}

TEST(CheckCamerasAgree, RefusesThreeOfFourCamerasThatAreExchanged) {
  const SimulatedWorld world = World();
  for (size_t right = 0; right < 4; ++right) {
    for (const size_t turn : {1, 2}) {
      const std::vector<CameraRows> given = RowsOf(world);
      std::vector<CameraRows> rows = given;
      std::vector<size_t> wrong;
      for (size_t c = 0; c < 4; ++c) {
        if (c != right) wrong.push_back(c);
      }
      for (size_t i = 0; i < 3; ++i) rows[wrong[i]].rows = given[wrong[(i + turn) % 3]].rows;
      EXPECT_THAT(Check(TrueResult(world), rows),
                  StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("Calibrate anew")));
    }
  }
}

TEST(DescribeLeftOut, CountsRowsByCamera) {
  const SimulatedWorld world = World();
  std::vector<CameraRows> rows = RowsOf(world);
  EXPECT_EQ(DescribeLeftOut(rows, {}), "");
  EXPECT_EQ(DescribeLeftOut(rows, {{"sim_1", 3}, {"sim_3", 150}}),
            "3 of 150 rows of sim_1, 150 of 150 rows of sim_3");
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
