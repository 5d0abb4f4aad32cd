// SPDX-License-Identifier: Apache-2.0
#include "client/tables/frame_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace rigcal::client::frame_table_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::InformationGroup* AddGroup(v1::InformationGroup::Kind kind,
                               v1::CalibrationInformation* information) {
  v1::InformationGroup* const group = information->add_groups();
  group->set_kind(kind);
  return group;
}

void AddParameter(const std::string& camera, v1::ParameterInformation::Kind kind,
                  const std::string& name, const std::vector<float>& share,
                  v1::CalibrationInformation* information) {
  v1::ParameterInformation* const parameter = information->add_parameters();
  parameter->set_camera(camera);
  parameter->set_kind(kind);
  parameter->set_name(name);
  parameter->set_sigma(0.001);
  parameter->mutable_share()->Assign(share.begin(), share.end());
}

TEST(FormatInformation, NamesWhatAWeakParameterRestsOn) {
  v1::CalibrationInformation information;
  v1::InformationGroup* const span = AddGroup(v1::InformationGroup::KIND_SPAN, &information);
  span->set_session_id("wave");
  span->set_from_s(20);
  span->set_to_s(30);
  AddGroup(v1::InformationGroup::KIND_CAMERA, &information)->set_camera("cam1");
  AddGroup(v1::InformationGroup::KIND_CAMERA, &information)->set_camera("cam3");
  AddParameter("cam3", v1::ParameterInformation::KIND_POSITION, "z", {0.91F, 1, -1}, &information);
  AddParameter("cam3", v1::ParameterInformation::KIND_ROTATION, "x", {0.8F, 1, -1}, &information);
  AddParameter("cam1", v1::ParameterInformation::KIND_POSITION, "x", {0.1F, -1, 0.74F},
               &information);
  const std::string text = FormatInformation("c-000001", information);
  EXPECT_THAT(text,
              HasSubstr("cam3's position along z, direction about x rest on 10.0 s of session "
                        "wave (20.0 to 30.0 s) and on cam1 alone\n"));
  EXPECT_THAT(text, Not(HasSubstr("cam1's")));
  EXPECT_THAT(text, HasSubstr("cam3: 74 %"));
  EXPECT_THAT(text, HasSubstr("1.000 mm"));
}

TEST(FormatInformation, SaysThatNothingIsWeak) {
  v1::CalibrationInformation information;
  information.set_calibration_id("c-000001");
  AddGroup(v1::InformationGroup::KIND_SESSION, &information)->set_session_id("wave");
  AddParameter("cam1", v1::ParameterInformation::KIND_TIME_OFFSET, "offset", {0.5F}, &information);
  const std::string text = FormatInformation("c-000002", information);
  EXPECT_THAT(text, HasSubstr("no weak spot"));
  EXPECT_THAT(text, HasSubstr("of the solve of c-000001"));
  EXPECT_THAT(text, HasSubstr("wave: 50 %"));
}

TEST(FormatFrame, SaysWhoseItIs) {
  v1::Calibration calibration;
  calibration.set_reference_camera("cam1");
  EXPECT_EQ(FormatFrame(calibration), "frame         that of camera cam1\n");
  v1::CalibrationFrame& frame = *calibration.mutable_frame();
  frame.set_source(v1::FRAME_SOURCE_NOT_KEPT);
  frame.set_calibration_id("c-000001");
  frame.set_problem("one camera is where it was");
  EXPECT_EQ(
      FormatFrame(calibration),
      "frame         that of camera cam1, NOT that of c-000001: one camera is where it was\n");
  frame.set_source(v1::FRAME_SOURCE_FLOOR);
  frame.set_residual_count(40);
  for (int i = 0; i < 40; ++i) frame.add_residuals()->set_name("marker");
  frame.set_residual_rms_m(0.00042);
  const std::string text = FormatFrame(calibration);
  EXPECT_THAT(text, HasSubstr("z = 0 is the floor, z up; from c-000001"));
  EXPECT_THAT(text, HasSubstr("0.420 mm rms"));
  EXPECT_THAT(text, HasSubstr("and 10 more\n"));
}

}  // namespace
}  // namespace rigcal::client::frame_table_test
