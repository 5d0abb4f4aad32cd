// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/commands/calibration_command.h"
#include "tests/client/command_runner.h"
#include "tests/client/fake_server.h"
#include "tests/client/sample_messages.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::client::calibration_accuracy_command_test {
namespace {

using nlohmann::json;
using ::rigcal::testing::CommandOutcome;
using ::rigcal::testing::FakeServer;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

v1::GetAccuracyResponse Answer() {
  v1::GetAccuracyResponse answer;
  answer.set_id("c-1");
  answer.set_sigma_px(0.3);
  answer.set_scale_sigma_rel(0.005);
  v1::PointAccuracy* point = answer.add_points();
  point->mutable_point_m()->set_x(1.25);
  point->set_camera_count(3);
  point->mutable_noise_sigma_m()->set_z(0.001);
  point->mutable_shape_sigma_m()->set_z(0.002);
  point->mutable_sigma_m()->set_z(0.0234);
  point->set_shape_total_m(0.002);
  point->set_total_m(0.0234);
  v1::PointAccuracy* unseen = answer.add_points();
  unseen->mutable_point_m()->set_z(-7);
  unseen->set_camera_count(1);
  answer.mutable_shape()->set_count(1);
  answer.mutable_shape()->set_worst_m(0.002);
  answer.mutable_with_scale()->set_count(1);
  answer.mutable_with_scale()->set_worst_m(0.0234);
  answer.set_calibration_p95_m(0.00175);
  answer.set_calibration_rms_m(0.00061);
  answer.set_frame_rms_m(0.0083);
  answer.set_noise_rms_m(0.00042);
  return answer;
}

class AccuracyCommand : public ::testing::Test {
 protected:
  AccuracyCommand() {
    fake_.calibrations["c-1"] = rigcal::testing::FullCalibration();
    fake_.accuracy = Answer();
  }
  CommandOutcome Rigcal(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"calibration", "accuracy"});
    arguments.insert(arguments.end(), {"--server", fake_.address()});
    return rigcal::testing::Rigcal(arguments);
  }

  FakeServer fake_;
};

TEST_F(AccuracyCommand, SendsPointsGridAndSigma) {
  const CommandOutcome outcome = Rigcal({"c-1", "--point", "1,2,3", "--point", "-0.5, 0 ,4e-1",
                                         "--grid", "0.25", "--sigma-px", "0.5", "-o", "json"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  ASSERT_EQ(fake_.asked_accuracy.points_m_size(), 2);
  EXPECT_EQ(fake_.asked_accuracy.points_m(0).z(), 3);
  EXPECT_EQ(fake_.asked_accuracy.points_m(1).x(), -0.5);
  EXPECT_EQ(fake_.asked_accuracy.points_m(1).z(), 0.4);
  EXPECT_EQ(fake_.asked_accuracy.grid_step_m(), 0.25);
  EXPECT_EQ(fake_.asked_accuracy.sigma_px(), 0.5);
  EXPECT_EQ(json::parse(outcome.out).at("points").size(), 2u);
}

TEST_F(AccuracyCommand, TableIsInMillimetres) {
  const CommandOutcome outcome = Rigcal({"c-1", "--point", "1,2,3"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("23.400"), HasSubstr("(1.250, 0.000, 0.000)"), HasSubstr("0.500 %"),
                    HasSubstr("Over these points"), HasSubstr("1.750 mm or less in 95 %")));
}

TEST_F(AccuracyCommand, StatesTheErrorFreeOfTheFrameFirst) {
  const std::string text = Rigcal({"c-1", "--point", "1,2,3"}).out;
  const auto calibration = text.find("shape of the rig   0.610 mm");
  const auto frame = text.find("rig frame          8.300 mm");
  ASSERT_NE(calibration, std::string::npos) << text;
  ASSERT_NE(frame, std::string::npos) << text;
  EXPECT_LT(calibration, frame);
  EXPECT_LT(frame, text.find("In the frame of the reference camera"));
  EXPECT_THAT(text, HasSubstr("centres' noise     0.420 mm (centres good to 0.30 px)"));
}

// What the calibration says of itself, by the same name and with the same number.
TEST_F(AccuracyCommand, HasTheHeadlineOfTheCalibration) {
  v1::Calibration& calibration = fake_.calibrations["c-1"];
  calibration.mutable_headline()->set_point_error_m(0.00378);
  const std::string text = Rigcal({"c-1"}).out;
  EXPECT_THAT(text, HasSubstr("expected error     3.78 mm"));
  const std::string line = text.substr(0, text.find('\n'));
  EXPECT_THAT(
      rigcal::testing::Rigcal({"calibration", "get", "c-1", "--server", fake_.address()}).out,
      HasSubstr(line));
}

// As in the calibration, and not the end of a bin.
TEST_F(AccuracyCommand, ResidualsHaveTheFiguresOfTheCalibration) {
  v1::CameraResiduals* left = fake_.residuals.add_cameras();
  left->set_camera(fake_.calibrations["c-1"].cameras(0).camera());
  left->set_bin_px(0.05);
  left->add_inlier_counts(10);
  auto* inlier =
      fake_.calibrations["c-1"].mutable_cameras(0)->mutable_residuals()->mutable_inlier();
  inlier->set_median_px(0.321);
  inlier->set_p95_px(0.987);
  const std::string text =
      rigcal::testing::Rigcal({"calibration", "residuals", "c-1", "--server", fake_.address()}).out;
  EXPECT_THAT(text, AllOf(HasSubstr("0.321"), HasSubstr("0.987"), Not(HasSubstr("0.050"))));
}

TEST_F(AccuracyCommand, SaysWhereNothingIsSeen) {
  fake_.accuracy.mutable_shape()->set_count(0);
  fake_.accuracy.mutable_with_scale()->set_count(0);
  const CommandOutcome outcome = Rigcal({"c-1", "--point", "0,0,-7"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("none is seen by two cameras"), Not(HasSubstr("worst at"))));
}

TEST_F(AccuracyCommand, WrongCommandLinesAreUsage) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{},
                                             {"c-1", "--point", "1,2"},
                                             {"c-1", "--point", "1,2,x"},
                                             {"c-1", "--point", "1,2,nan"},
                                             {"c-1", "--grid", "0"},
                                             {"c-1", "--grid", "-1"},
                                             {"c-1", "--sigma-px", "0"}}) {
    EXPECT_EQ(Rigcal(arguments).exit_code, 2) << ::testing::PrintToString(arguments);
  }
}

TEST_F(AccuracyCommand, NamesACalibrationThatDoesNotExist) {
  const CommandOutcome outcome = Rigcal({"c-9"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("c-9"));
}

TEST(ParsePoint, ReadsThreeNumbers) {
  ASSERT_OK_AND_ASSIGN(const v1::Vector3 point, ParsePoint("0.5,-0.25, 3"));
  EXPECT_EQ(point.y(), -0.25);
  for (const char* wrong : {"", "1", "1,2", "1,2,3,4", "1,,3", "a,b,c", "1,2,inf"}) {
    EXPECT_THAT(ParsePoint(wrong),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("0.5,-0.2,3")))
        << wrong;
  }
}

}  // namespace
}  // namespace rigcal::client::calibration_accuracy_command_test
