// SPDX-License-Identifier: Apache-2.0
#include "client/tables/notable_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "client/tables/calibration_table.h"
#include "client/tables/session_table.h"
#include "tests/client/sample_messages.h"

namespace rigcal::client::notable_cameras_test {
namespace {

using ::rigcal::testing::FullCalibration;
using ::rigcal::testing::FullSession;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

v1::Calibration CalibrationOf(int count) {
  v1::Calibration calibration = FullCalibration();
  const v1::CalibratedCamera sample = calibration.cameras(0);
  calibration.clear_cameras();
  calibration.clear_findings();
  for (int i = 0; i < count; ++i) {
    v1::CalibratedCamera* camera = calibration.add_cameras();
    *camera = sample;
    camera->set_camera(absl::StrCat("cam_", i, "_"));
  }
  return calibration;
}

void AddFinding(v1::Calibration* calibration, int camera, v1::FindingSeverity severity) {
  v1::Finding* finding = calibration->add_findings();
  finding->set_camera(calibration->cameras(camera).camera());
  finding->set_severity(severity);
  finding->set_advice(absl::StrCat("advice ", camera));
}

v1::Session SessionOf(int count) {
  v1::Session session = FullSession();
  v1::SessionCamera sample = session.cameras(0);
  sample.clear_refused();
  session.clear_cameras();
  for (int i = 0; i < count; ++i) {
    v1::SessionCamera* camera = session.add_cameras();
    *camera = sample;
    camera->mutable_description()->set_camera(absl::StrCat("cam_", i, "_"));
    camera->set_connected(true);
    camera->set_ended(true);
  }
  return session;
}

TEST(NeedsSummary, CountsAndNamesTheFirst) {
  EXPECT_EQ(NeedsSummary(500, {}), "all 500 good");
  EXPECT_EQ(NeedsSummary(500, {"a"}), "499 good, 1 needs something: a");
  EXPECT_EQ(NeedsSummary(500, {"a", "b"}), "498 good, 2 need something: a, b");
  EXPECT_EQ(NeedsSummary(20, {"a", "b", "c", "d", "e", "f", "g", "h", "i"}),
            "11 good, 9 need something: a, b, c, d, e, f, g, h, ...");
}

TEST(KeepNotableCameras, OfACalibrationThoseThatFindingsName) {
  v1::Calibration calibration = CalibrationOf(500);
  AddFinding(&calibration, 7, v1::FINDING_SEVERITY_WARNING);
  AddFinding(&calibration, 8, v1::FINDING_SEVERITY_INFO);
  AddFinding(&calibration, 480, v1::FINDING_SEVERITY_ERROR);
  AddFinding(&calibration, 9, v1::FINDING_SEVERITY_ERROR);
  calibration.mutable_findings(3)->set_candidate(true);
  EXPECT_THAT(CamerasInNeed(calibration), ElementsAre("cam_7_", "cam_480_"));
  const std::string text = FormatCalibration(calibration);
  EXPECT_THAT(text, AllOf(HasSubstr("498 good, 2 need something: cam_7_, cam_480_"),
                          HasSubstr("--all"), HasSubstr("\n  cam_480_ "), HasSubstr("advice 480"),
                          Not(HasSubstr("cam_8_")), Not(HasSubstr("cam_100_"))));
  const std::string whole = FormatWholeCalibration(calibration);
  EXPECT_THAT(whole, AllOf(HasSubstr("\n  cam_100_ "), HasSubstr("advice 8\n"),
                           Not(HasSubstr("need something"))));
}

TEST(KeepNotableCameras, OfAGoodOneTheFirstFew) {
  const std::string text = FormatCalibration(CalibrationOf(17));
  EXPECT_THAT(text, AllOf(HasSubstr("all 17 good"), HasSubstr("\n  cam_0_ "),
                          HasSubstr("\n  cam_3_ "), Not(HasSubstr("cam_4_"))));
}

TEST(KeepNotableCameras, UpToSixteenAreAllListed) {
  v1::Calibration calibration = CalibrationOf(16);
  AddFinding(&calibration, 7, v1::FINDING_SEVERITY_WARNING);
  EXPECT_EQ(FormatCalibration(calibration), FormatWholeCalibration(calibration));
  const v1::Session session = SessionOf(16);
  EXPECT_EQ(FormatSession(session), FormatWholeSession(session));
}

TEST(KeepNotableCameras, OfASessionThoseThatAreAwayOrHaveLostSomething) {
  v1::Session session = SessionOf(500);
  EXPECT_THAT(CamerasInNeed(session), IsEmpty());
  session.mutable_cameras(3)->set_ended(false);
  session.mutable_cameras(4)->set_ended(false);
  session.mutable_cameras(4)->set_connected(false);
  session.mutable_cameras(5)->mutable_frames()->set_lost(1);
  session.mutable_cameras(6)->add_refused()->set_count(2);
  session.set_state(v1::Session::STATE_CAPTURING);
  EXPECT_THAT(CamerasInNeed(session), ElementsAre("cam_4_", "cam_5_", "cam_6_"));
  session.set_state(v1::Session::STATE_FINISHED);
  EXPECT_THAT(CamerasInNeed(session), ElementsAre("cam_3_", "cam_4_", "cam_5_", "cam_6_"));
  const std::string text = FormatSession(session);
  EXPECT_THAT(text, AllOf(HasSubstr("496 good, 4 need something: cam_3_, "),
                          HasSubstr("\n  cam_6_ "), Not(HasSubstr("cam_7_"))));
  EXPECT_THAT(FormatWholeSession(session), HasSubstr("\n  cam_499_ "));
  EXPECT_THAT(FormatSessionLine(session),
              AllOf(HasSubstr("498 complete"), HasSubstr("496 good, 4 need something"),
                    Not(HasSubstr("cam_7_"))));
}

}  // namespace
}  // namespace rigcal::client::notable_cameras_test
