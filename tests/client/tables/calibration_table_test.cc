// SPDX-License-Identifier: Apache-2.0
#include "client/tables/calibration_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "rigcal/v1/calibration_service.pb.h"
#include "tests/client/sample_messages.h"

namespace rigcal::client::calibration_table_test {
namespace {

using ::rigcal::testing::FullCalibration;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(FormatCalibration, ShowsResidualsOfEachCamera) {
  const std::string text = FormatCalibration(FullCalibration());
  EXPECT_THAT(text, ContainsRegex("camera +observations +markers +outliers +mean +rms +mean +rms"
                                  " +median +p95\n"));
  EXPECT_THAT(text, ContainsRegex("left +600 +1800 +12 +0.250 +0.375 +0.500 +0.750 "
                                  "+0.250 +1.500\n"));
  EXPECT_THAT(text, HasSubstr("of the markers used (px)"));
}

TEST(FormatCalibration, BeginsWithTheGradeAndTheHeadline) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_headline()->set_point_error_m(0.000294);
  calibration.mutable_headline()->set_used_mean_px(0.331);
  calibration.mutable_headline()->set_unused_share(0.012);
  calibration.mutable_target()->set_scale_sigma_rel(0.0069);
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, HasSubstr("expected error     0.29 mm + 0.69 % of every length"));
  EXPECT_THAT(text, HasSubstr("measure the wand to 0.2 mm"));
  EXPECT_THAT(text, HasSubstr("0.331 px, mean of the markers used; 1.2 % of the views not used"));
  EXPECT_LT(text.find("Quality: usable"), text.find("expected error"));
  EXPECT_LT(text.find("expected error"), text.find("Reprojection errors"));
  EXPECT_EQ(text.find("from the"), std::string::npos) << "a server that does not say";
  EXPECT_EQ(text.find("at most"), std::string::npos) << "a server that does not say";
  calibration.mutable_headline()->set_point_error_bound_m(0.00061);
  EXPECT_THAT(FormatCalibration(calibration), HasSubstr("\n                   0.61 mm at most"));
  calibration.mutable_quality()->set_grade(v1::Quality::GRADE_BAD);
  EXPECT_THAT(FormatCalibration(calibration), HasSubstr("expected error     at least 0.29 mm"));
  EXPECT_EQ(FormatCalibration(calibration).find("at most"), std::string::npos);
}

TEST(FormatCalibration, SaysWhatTheExpectedErrorIsFrom) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_headline()->set_point_error_m(0.000294);
  const auto text_with = [&](v1::Headline::ErrorBasis basis) {
    calibration.mutable_headline()->set_point_error_basis(basis);
    return FormatCalibration(calibration);
  };
  EXPECT_THAT(text_with(v1::Headline::ERROR_BASIS_COVARIANCE), HasSubstr("from the covariance"));
  EXPECT_THAT(text_with(v1::Headline::ERROR_BASIS_LENSES), HasSubstr("change with the lenses"));
  EXPECT_THAT(text_with(v1::Headline::ERROR_BASIS_FOLDS), HasSubstr("from the folds"));
}

TEST(FormatCalibration, ShowsWhereTheCamerasAre) {
  const std::string text = FormatCalibration(FullCalibration());
  // The reference camera is the origin; the other looks along -x from (3, 0, 1.5).
  EXPECT_THAT(text, ContainsRegex("left +0.0000 +0.0000 +0.0000 +0.000 +0.000 +0.000"));
  EXPECT_THAT(text, ContainsRegex("right +3.0000 +0.0000 +1.5000 +0.000 +-90.000 +0.000"));
  EXPECT_THAT(text, AllOf(HasSubstr("position (m)"), HasSubstr("rotation vector (deg)"),
                          HasSubstr("frame of left"), HasSubstr("rig_from_cam")));
  EXPECT_THAT(text, HasSubstr("-8.150"));
}

TEST(FormatCalibration, ShowsInstantsWandTimeAndRefusals) {
  const std::string text = FormatCalibration(FullCalibration());
  EXPECT_THAT(text, ContainsRegex("instants used +614\n"));
  EXPECT_THAT(text, ContainsRegex("wand length error +0.580 mm rms over 1200 spans"));
  EXPECT_THAT(text, ContainsRegex("time taken +1.25 s\n"));
  EXPECT_THAT(text, ContainsRegex("left +clock_epoch_without_offset +6 +row 620 of left.csv"));
  EXPECT_THAT(text,
              ContainsRegex("clock_offset +warning +left +-8.15 +ms +check the trigger cable"));
  EXPECT_THAT(text, HasSubstr("Quality: usable\n  left is late\n"));
}

TEST(FormatCalibration, ShowsEveryTargetWithItsSessions) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_target()->add_session_ids("wave");
  v1::CalibratedTarget* board = calibration.add_other_targets();
  board->mutable_given()->set_kind(v1::Target::KIND_RIGID);
  for (int i = 0; i < 4; ++i) board->mutable_given()->add_points();
  board->add_session_ids("board");
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, ContainsRegex("target +wand, waved in wave\nwand length error +0.580 mm rms"));
  EXPECT_THAT(text,
              ContainsRegex("target +rigid, 4 points, waved in board; one sigma of the scale"));
  EXPECT_EQ(text.find("rigid"), text.rfind("rigid")) << "once";
}

TEST(FormatCalibration, ShowsWhereStaticPointsAreAndThatTheySayNothingOfClocks) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_target()->add_session_ids("wave");
  v1::CalibratedTarget* room = calibration.add_other_targets();
  room->mutable_given()->set_kind(v1::Target::KIND_STATIC);
  for (int i = 0; i < 3; ++i) room->mutable_given()->add_points();
  room->add_session_ids("room");
  v1::CalibratedPoint* point = room->add_static_points();
  point->set_label("corner");
  point->mutable_position_m()->set_x(1.25);
  point->mutable_position_m()->set_y(-0.5);
  point->mutable_position_m()->set_z(3);
  point->set_camera_count(2);
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, ContainsRegex("target +static, 3 points, 1 placed, seen in room\n"));
  EXPECT_THAT(text, HasSubstr("nothing of the cameras' clocks"));
  EXPECT_THAT(text, ContainsRegex("corner +1.2500 +-0.5000 +3.0000 +2\n"));
}

TEST(FormatCalibration, SaysThatASplineThatWasAskedForWasNotUsed) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_trajectory()->set_kind(v1::CalibratedTrajectory::KIND_INTERPOLATED);
  EXPECT_THAT(FormatCalibration(calibration), Not(HasSubstr("NOT the spline")));
  calibration.mutable_options()->set_trajectory(v1::CalibrationOptions::TRAJECTORY_SPLINE);
  EXPECT_THAT(FormatCalibration(calibration), HasSubstr("NOT the spline that was asked for"));
  calibration.mutable_trajectory()->set_kind(v1::CalibratedTrajectory::KIND_SPLINE);
  EXPECT_THAT(FormatCalibration(calibration), Not(HasSubstr("NOT the spline")));
}

TEST(FormatCalibration, ShowsTheEvaluationWhereThereIsOne) {
  v1::Calibration calibration = FullCalibration();
  EXPECT_THAT(
      FormatCalibration(calibration),
      AllOf(HasSubstr("with left held fixed"), ContainsRegex("left +0.500 +0.0057 +0.000\n"),
            ContainsRegex("left +0.500 +0.750 +1.500 +0.750 +1.125 +2.250\n")));
  calibration.mutable_cameras(0)->clear_held_out();
  EXPECT_THAT(FormatCalibration(calibration),
              ContainsRegex("left +- +- +- +0.750 +1.125 +2.250\n"));
  for (v1::CalibratedCamera& camera : *calibration.mutable_cameras()) {
    camera.clear_uncertainty();
    camera.clear_held_out();
    camera.clear_leave_one_out();
  }
  EXPECT_THAT(FormatCalibration(calibration),
              AllOf(Not(HasSubstr("held out")), Not(HasSubstr("held fixed"))));
}

TEST(FormatCalibration, MarksOffsetsThatAreNoEstimates) {
  v1::Calibration calibration = FullCalibration();
  EXPECT_THAT(FormatCalibration(calibration), Not(HasSubstr("not estimated")));
  calibration.mutable_cameras(1)->set_time_offset_estimated(false);
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, HasSubstr("not estimated"));
  EXPECT_THAT(text, ContainsRegex("left [^\n]*-8.150   "));
  EXPECT_THAT(text, ContainsRegex("right [^\n]*-8.150\\*  "));
}

TEST(FormatCalibration, NeverCallsUnknownScaleMetres) {
  v1::Calibration calibration = FullCalibration();
  calibration.set_scale_known(false);
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, AllOf(HasSubstr("unknown scale"), HasSubstr("NOT KNOWN")));
  EXPECT_THAT(text, Not(HasSubstr("position (m)")));
  EXPECT_THAT(text, Not(HasSubstr("position (mm)")));
  calibration.set_reference_camera("left");
  calibration.set_unit_camera("right");
  EXPECT_THAT(FormatCalibration(calibration),
              HasSubstr("the unit is the distance from left to right"));
}

TEST(FormatCalibration, OfOneMarkerSaysWhereTheScaleIsFrom) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_target()->mutable_given()->set_kind(v1::Target::KIND_POINT);
  calibration.mutable_target()->set_scale_sigma_rel(0.0008);
  v1::KnownDistance* known = calibration.mutable_options()->mutable_known_distance();
  known->set_camera_a("left");
  known->set_camera_b("right");
  known->set_distance_m(1.25);
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, HasSubstr("from the distance of left and right, 1.2500 m, one sigma 0.080 %"));
  EXPECT_THAT(text, Not(HasSubstr("wand length")));
}

TEST(FormatCalibration, OfAFailedOneSaysWhyAndWhatWasLeftOut) {
  v1::Calibration failed = FullCalibration();
  failed.set_state(v1::Calibration::STATE_FAILED);
  failed.set_error("cameras {left} and {right} share no instants");
  const std::string text = FormatCalibration(failed);
  EXPECT_THAT(text, AllOf(HasSubstr("failed"), HasSubstr("share no instants"),
                          HasSubstr("clock_epoch_without_offset")));
  EXPECT_THAT(text, Not(HasSubstr("instants used")));
}

TEST(FormatCalibration, FitsANormalTerminalForUsualRigs) {
  v1::Calibration calibration = FullCalibration();
  calibration.clear_findings();
  calibration.clear_refused();
  std::istringstream lines(FormatCalibration(calibration));
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
}

TEST(FormatCalibration, ShowsAFindingOfALaterVersionWithWhatItSays) {
  v1::Calibration calibration = FullCalibration();
  calibration.mutable_findings(0)->set_kind(static_cast<v1::FindingKind>(999));
  calibration.mutable_findings(0)->set_advice("mind the gap");
  EXPECT_THAT(FormatCalibration(calibration),
              AllOf(HasSubstr("unknown kind 999"), HasSubstr("mind the gap")));
}

TEST(FormatCalibration, CannotSteerTheTerminal) {
  v1::Calibration calibration = FullCalibration("\x1b[2J");
  calibration.set_reference_camera("\x1b[2J");
  calibration.mutable_cameras(0)->set_camera("\x1b[2J");
  calibration.mutable_quality()->set_reasons(0, "\x1b[2J");
  calibration.mutable_refused(0)->set_example("\x1b[2J");
  EXPECT_THAT(FormatCalibration(calibration), Not(HasSubstr("\x1b")));
  calibration.set_state(v1::Calibration::STATE_FAILED);
  calibration.set_error("\x1b[2J");
  EXPECT_THAT(FormatCalibration(calibration), Not(HasSubstr("\x1b")));
}

TEST(FormatCalibration, SurvivesAnEmptyMessage) {
  v1::Calibration calibration;
  EXPECT_THAT(FormatCalibration(calibration), HasSubstr("state 0"));
  calibration.set_state(v1::Calibration::STATE_SUCCEEDED);
  calibration.add_cameras();
  EXPECT_THAT(FormatCalibration(calibration), HasSubstr("instants used"));
}

TEST(FormatCalibrationProgress, IsOneLine) {
  v1::Calibration calibration;
  calibration.set_state(v1::Calibration::STATE_RUNNING);
  calibration.mutable_progress()->set_stage(v1::CALIBRATION_STAGE_ADJUSTING);
  calibration.mutable_progress()->set_fraction(0.4);
  EXPECT_EQ(FormatCalibrationProgress(calibration), "calibrating: adjusting 40 %");
  calibration.mutable_progress()->set_not_responding(true);
  EXPECT_EQ(FormatCalibrationProgress(calibration), "calibrating: adjusting 40 %, not responding");
  v1::ListCalibrationsResponse list;
  *list.add_calibrations() = calibration;
  EXPECT_THAT(FormatCalibrationList(list), HasSubstr("running, not responding"));
  calibration.mutable_progress()->set_not_responding(false);
  calibration.mutable_progress()->set_fraction(7);
  EXPECT_EQ(FormatCalibrationProgress(calibration), "calibrating: adjusting 100 %");
  calibration.set_state(v1::Calibration::STATE_QUEUED);
  EXPECT_EQ(FormatCalibrationProgress(calibration), "calibration queued");
  calibration.mutable_progress()->set_waiting("no rigcal-worker runs");
  EXPECT_EQ(FormatCalibrationProgress(calibration), "calibration queued: no rigcal-worker runs");
}

TEST(FormatCalibrationProgress, NamesWhoSolvesElsewhere) {
  v1::Calibration calibration;
  calibration.set_state(v1::Calibration::STATE_RUNNING);
  calibration.mutable_progress()->set_stage(v1::CALIBRATION_STAGE_READING);
  calibration.mutable_progress()->set_solved_by("rigcal-worker on pc-2 (process 311)");
  EXPECT_EQ(FormatCalibrationProgress(calibration),
            "calibrating: reading 0 %, by rigcal-worker on pc-2 (process 311)");
}

TEST(FormatCalibrationList, HasARowForEach) {
  v1::ListCalibrationsResponse response;
  EXPECT_EQ(FormatCalibrationList(response), "no calibrations\n");
  *response.add_calibrations() = FullCalibration("cal-2");
  *response.add_calibrations() = FullCalibration("cal-1");
  EXPECT_THAT(FormatCalibrationList(response),
              ContainsRegex("cal-2 +rig +3 +succeeded +614 +usable .*wave\ncal-1 "));
}

}  // namespace
}  // namespace rigcal::client::calibration_table_test
