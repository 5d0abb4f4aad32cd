// SPDX-License-Identifier: Apache-2.0
#include "common/export/camera_file_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::testing::camera_file_names_test {
namespace {

using ::testing::ElementsAre;

std::vector<std::string> NamesOf(const std::vector<std::string>& cameras) {
  ExportedRig rig;
  for (const std::string& camera : cameras) rig.cameras.emplace_back().name = camera;
  return CameraFileNames(rig);
}

TEST(CameraFileNames, AreThoseOfTheCameras) {
  EXPECT_THAT(NamesOf({"left", "cam.1", "COMA", "console"}),
              ElementsAre("left", "cam.1", "COMA", "console"));
}

TEST(CameraFileNames, AreNoOptionsAndNoDevices) {
  EXPECT_THAT(
      NamesOf({"-rf", "CON", "nul.left", "com1", "Lpt9"}),
      ElementsAre("camera_-rf", "camera_CON", "camera_nul.left", "camera_com1", "camera_Lpt9"));
}

TEST(CameraFileNames, DifferWhereCapitalsDoNotCount) {
  EXPECT_THAT(NamesOf({"Left", "LEFT", "left", "left_2"}),
              ElementsAre("Left", "LEFT_2", "left_3", "left_2_2"));
}

}  // namespace
}  // namespace rigcal::testing::camera_file_names_test
