// SPDX-License-Identifier: Apache-2.0
#include "common/import/convention.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/import/imported_texts.h"

namespace rigcal::convention_test {
namespace {

using ::rigcal::testing::RingOfCameras;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

const std::vector<double> kNoDistortion(5, 0.0);

TEST(CountLookingTogether, KnowsARingFromItsInverse) {
  std::vector<ImportedCamera> cameras = RingOfCameras(6, kNoDistortion);
  EXPECT_EQ(CountLookingTogether(cameras), 6);
  for (ImportedCamera& camera : cameras) camera.cam_from_rig = camera.cam_from_rig->Inverse();
  EXPECT_LE(CountLookingTogether(cameras), 3);
}

TEST(RecogniseConvention, LeavesADocumentedFileAlone) {
  ImportedRig rig{"kalibr", RingOfCameras(6, kNoDistortion), {}};
  RecogniseConvention(&rig);
  EXPECT_THAT(rig.notes, IsEmpty());
  EXPECT_EQ(CountLookingTogether(rig.cameras), 6);
}

TEST(RecogniseConvention, FindsEveryOtherWayAndSaysSo) {
  const std::vector<ImportedCamera> cameras = RingOfCameras(6, kNoDistortion);
  const RigidTransform flip(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero());
  for (int way = 0; way < 3; ++way) {
    SCOPED_TRACE(way);
    ImportedRig rig{"kalibr", cameras, {}};
    for (ImportedCamera& camera : rig.cameras) {
      const RigidTransform pose = *camera.cam_from_rig;
      camera.cam_from_rig = way == 0   ? pose.Inverse()
                            : way == 1 ? (flip * pose).Inverse()
                                       : flip * pose;
    }
    RecogniseConvention(&rig);
    ASSERT_THAT(rig.notes, SizeIs(1));
    EXPECT_THAT(rig.notes[0], HasSubstr("with which 6 do"));
    for (size_t i = 0; i < cameras.size(); ++i) {
      EXPECT_TRUE(
          rig.cameras[i].cam_from_rig->Matrix().isApprox(cameras[i].cam_from_rig->Matrix(), 1e-9));
    }
  }
}

// Two cameras may stand back to back; nothing can be told of them.
TEST(RecogniseConvention, DecidesNothingForTwoCameras) {
  ImportedRig rig{"kalibr", RingOfCameras(2, kNoDistortion), {}};
  for (ImportedCamera& camera : rig.cameras) camera.cam_from_rig = camera.cam_from_rig->Inverse();
  const Eigen::Matrix4d before = rig.cameras[0].cam_from_rig->Matrix();
  RecogniseConvention(&rig);
  EXPECT_THAT(rig.notes, IsEmpty());
  EXPECT_EQ(rig.cameras[0].cam_from_rig->Matrix(), before);
}

// Cameras that look outwards have no common point in any reading.
TEST(RecogniseConvention, DecidesNothingForCamerasThatLookAway) {
  ImportedRig rig{"kalibr", RingOfCameras(6, kNoDistortion), {}};
  const RigidTransform turn(Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d::UnitY())),
                            Eigen::Vector3d::Zero());
  for (ImportedCamera& camera : rig.cameras) camera.cam_from_rig = turn * *camera.cam_from_rig;
  const Eigen::Matrix4d before = rig.cameras[0].cam_from_rig->Matrix();
  RecogniseConvention(&rig);
  EXPECT_THAT(rig.notes, IsEmpty());
  EXPECT_EQ(rig.cameras[0].cam_from_rig->Matrix(), before);
}

}  // namespace
}  // namespace rigcal::convention_test
