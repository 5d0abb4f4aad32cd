// SPDX-License-Identifier: Apache-2.0
#include "common/wire/calibration_result_wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace rigcal::wire::calibration_result_wire_test {
namespace {

using ::testing::SizeIs;

TEST(CalibrationResultWire, ResidualsOfListsThatDifferInLength) {
  v1::CameraResiduals proto;
  for (const float x_px : {0.0F, 1.0F, 2.0F}) {
    proto.add_x_px(x_px);
    proto.add_y_px(10 + x_px);
    proto.add_dx_px(0.25);
    proto.add_dy_px(0.5);
  }
  proto.add_outlier(false);
  proto.add_outlier(true);
  const CameraResiduals residuals = FromProto(proto);
  ASSERT_THAT(residuals.vectors, SizeIs(2));
  EXPECT_EQ(residuals.vectors[1].x_px, 1);
  EXPECT_EQ(residuals.vectors[1].y_px, 11);
  EXPECT_TRUE(residuals.vectors[1].outlier);
}

TEST(CalibrationResultWire, ASolverPathOfANewerServerIsUnknown) {
  CalibrationResult result;
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.quality.grade = QualityGrade::kGood;
  result.solver_path = SolverPath::kGeneral;
  v1::Calibration proto;
  FillResult(result, &proto);
  ASSERT_OK_AND_ASSIGN(CalibrationResult back, ResultFromProto(proto));
  EXPECT_EQ(back.solver_path, SolverPath::kGeneral);
  proto.set_solver_path(static_cast<v1::SolverPath>(99));
  ASSERT_OK_AND_ASSIGN(back, ResultFromProto(proto));
  EXPECT_EQ(back.solver_path, SolverPath::kUnknown);
}

TEST(CalibrationResultWire, AnErrorBasisOfANewerServerIsUnknown) {
  CalibrationResult result;
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.headline = {.point_error_m = 0.001,
                     .point_error_bound_m = 0.002,
                     .point_error_basis = ErrorBasis::kLenses};
  v1::Calibration proto;
  FillResult(result, &proto);
  ASSERT_OK_AND_ASSIGN(CalibrationResult back, ResultFromProto(proto));
  ASSERT_TRUE(back.headline.has_value());
  EXPECT_EQ(back.headline->point_error_basis, ErrorBasis::kLenses);
  EXPECT_EQ(back.headline->point_error_bound_m, 0.002);
  proto.mutable_headline()->set_point_error_basis(static_cast<v1::Headline::ErrorBasis>(99));
  ASSERT_OK_AND_ASSIGN(back, ResultFromProto(proto));
  EXPECT_EQ(back.headline->point_error_basis, ErrorBasis::kUnknown);
}

TEST(CalibrationResultWire, CarriesStaticPoints) {
  CalibrationResult result;
  result.quality.grade = QualityGrade::kGood;
  result.target.given.kind = TargetKind::kStatic;
  result.target.given.points = {{"door", 0, 0, 0, 0}, {"shelf", 0, 0, 0, 0}};
  result.target.static_points = {{"shelf", "room", {1, 2, 3}, 4}};
  v1::Calibration proto;
  FillResult(result, &proto);
  ASSERT_OK_AND_ASSIGN(const CalibrationResult back, ResultFromProto(proto));
  EXPECT_EQ(back.target.given, result.target.given);
  ASSERT_EQ(back.target.static_points.size(), 1u);
  EXPECT_EQ(back.target.static_points[0].label, "shelf");
  EXPECT_EQ(back.target.static_points[0].session_id, "room");
  EXPECT_EQ(back.target.static_points[0].position_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(back.target.static_points[0].camera_count, 4u);
}

TEST(CalibrationResultWire, CarriesTheTrajectory) {
  CalibrationResult result;
  result.target.given.marker_positions_m = {0, 0.13, 0.39};
  result.quality.grade = QualityGrade::kGood;
  result.trajectory = {CalibratedTrajectory::Kind::kSpline, 0.025, 3.5, 17, 0.42, 0.41};
  v1::Calibration proto;
  FillResult(result, &proto);
  ASSERT_OK_AND_ASSIGN(CalibrationResult back, ResultFromProto(proto));
  EXPECT_EQ(back.trajectory.kind, CalibratedTrajectory::Kind::kSpline);
  EXPECT_EQ(back.trajectory.knot_spacing_s, 0.025);
  EXPECT_EQ(back.trajectory.jerk_density, 3.5);
  EXPECT_EQ(back.trajectory.added_row_count, 17u);
  EXPECT_EQ(back.trajectory.held_out_interpolated_px, 0.42);
  EXPECT_EQ(back.trajectory.held_out_spline_px, 0.41);
  proto.mutable_trajectory()->set_kind(static_cast<v1::CalibratedTrajectory::Kind>(99));
  ASSERT_OK_AND_ASSIGN(back, ResultFromProto(proto));
  EXPECT_EQ(back.trajectory.kind, CalibratedTrajectory::Kind::kUnknown);
}

}  // namespace
}  // namespace rigcal::wire::calibration_result_wire_test
