// SPDX-License-Identifier: Apache-2.0
#include "client/results/import_units.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

ImportedRig RigOf(double distance) {
  ImportedRig rig{"anipose", {}, {}};
  for (const double x : {0.0, distance}) {
    ImportedCamera camera;
    camera.name = x == 0 ? "left" : "right";
    camera.cam_from_rig = RigidTransform(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x, 0, 0));
    rig.cameras.push_back(camera);
  }
  return rig;
}

TEST(ApplyUnits, NamesTheUnitThatFits) {
  ImportedRig rig = RigOf(4213);
  const std::string doubt = ApplyUnits("rig.toml", "", &rig);
  EXPECT_THAT(doubt, AllOf(HasSubstr("left and right"), HasSubstr("4213.0 m apart"),
                           HasSubstr("1/1000"), HasSubstr("4.213 m"), HasSubstr("--units mm")));
  EXPECT_EQ(rig.cameras[1].cam_from_rig->translation_m.x(), -4213) << "nothing is done in silence";
  rig = RigOf(250);
  EXPECT_THAT(ApplyUnits("rig.toml", "", &rig),
              AllOf(HasSubstr("2.500 m"), HasSubstr("--units cm"), HasSubstr("--units mm")));
}

TEST(ApplyUnits, LeavesARigInMetresAlone) {
  for (const double distance : {0.06, 4.0, 60.0}) {
    ImportedRig rig = RigOf(distance);
    EXPECT_EQ(ApplyUnits("rig.toml", "", &rig), "");
    EXPECT_EQ(rig.cameras[1].cam_from_rig->translation_m.x(), -distance);
  }
  ImportedRig lenses = RigOf(4213);
  for (ImportedCamera& camera : lenses.cameras) camera.cam_from_rig.reset();
  EXPECT_EQ(ApplyUnits("rig.toml", "", &lenses), "");
}

TEST(ApplyUnits, MakesMetres) {
  for (const auto& [unit, metres] : {std::pair("mm", 4.213), {"cm", 42.13}, {"m", 4213.0}}) {
    ImportedRig rig = RigOf(4213);
    EXPECT_EQ(ApplyUnits("rig.toml", unit, &rig), "");
    EXPECT_NEAR(rig.cameras[1].cam_from_rig->translation_m.x(), -metres, 1e-9) << unit;
  }
}

}  // namespace
}  // namespace rigcal::client
