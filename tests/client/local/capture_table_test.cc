// SPDX-License-Identifier: Apache-2.0
#include "client/local/capture_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace rigcal::client::capture_table_test {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

v1::SessionCamera* Add(const std::string& name, uint32_t count, v1::Session* session) {
  v1::SessionCamera* camera = session->add_cameras();
  camera->mutable_description()->set_camera(name);
  camera->set_observation_count(count);
  session->set_observation_count(session->observation_count() + count);
  return camera;
}

TEST(CaptureProgress, TellsEachCameraAndTheShareThatHasCome) {
  v1::Session session;
  Add("left", 25, &session);
  Add("right", 100, &session)->set_ended(true);
  // What is more than expected of one does not stand for the other.
  const std::vector<LocalCamera> cameras = {{"left", "", 50}, {"right", "", 50}};
  EXPECT_EQ(FormatCaptureProgress(session, cameras), "capturing 75 %: left 25 right 100");
}

TEST(CaptureProgress, WithoutAnExpectationThereIsNoShare) {
  v1::Session session;
  Add("left", 25, &session);
  EXPECT_EQ(FormatCaptureProgress(session, {{"left", "", 0}}), "capturing: left 25");
  EXPECT_EQ(FormatCaptureProgress({}, {}), "capturing: 0 observations, 0 of 0 cameras complete");
}

TEST(CaptureProgress, ManyCamerasAreToldTogether) {
  v1::Session session;
  std::vector<LocalCamera> cameras;
  for (int i = 0; i < 20; ++i) {
    Add(absl::StrCat("camera_", i), 10, &session)->set_ended(i < 3);
    cameras.push_back({absl::StrCat("camera_", i), "", 20});
  }
  EXPECT_EQ(FormatCaptureProgress(session, cameras),
            "capturing 50 %: 200 observations, 3 of 20 cameras complete");
}

TEST(CaptureTable, TellsRatesAndWhatTheCalibrationUses) {
  LocalOutcome outcome;
  outcome.capture_s = 3;
  v1::SessionCamera* frame = Add("front", 101, &outcome.session);
  frame->mutable_description()->set_sensor(v1::CameraDescription::SENSOR_FRAME);
  frame->set_wand_count(90);
  v1::SessionCamera* event = Add("side", 400, &outcome.session);
  event->mutable_description()->set_sensor(v1::CameraDescription::SENSOR_EVENT);
  event->set_wand_count(395);
  v1::CalibratedCamera* used = outcome.calibration.add_cameras();
  used->set_camera("side");
  used->mutable_residuals()->set_observation_count(390);
  EXPECT_THAT(FormatCapture(outcome, 2),
              AllOf(HasSubstr("2.0 s of waving in 3.00 s"),
                    ContainsRegex("front +frame +101 +50.5 +90 +-\n"),
                    ContainsRegex("side +event +400 +200.0 +395 +390\n")));
  EXPECT_THAT(FormatCapture(outcome, 0),
              AllOf(Not(HasSubstr("per second")), Not(HasSubstr("s of"))));
}

}  // namespace
}  // namespace rigcal::client::capture_table_test
