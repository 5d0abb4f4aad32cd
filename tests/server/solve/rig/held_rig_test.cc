// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/held_rig.h"

#include <gtest/gtest.h>

#include "tests/server/solve/exact_problem.h"

namespace rigcal::server::held_rig_test {
namespace {

BundleProblem ThreeCameras() {
  return ExactProblem({{0, 0, 0}, {1, 0, 0}, {0.5, 0.8, 0.1}},
                      {{{0, 0, 3}}, {{0.4, 0.2, 3.5}, {0, 1, 0}}, {{-0.3, 0, 2.5}, {1, 1, 0}}});
}

RigidTransform HeldFromInitial() {
  return RigidTransform(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized())),
      Eigen::Vector3d(0.3, -2, 1.5));
}

TEST(MoveToHeldTest, TakesTheOthersAndTheTargetAlong) {
  const BundleProblem initial = ThreeCameras();
  const RigidTransform held_from_initial = HeldFromInitial();
  HeldRig held;
  held.cam_from_rig.resize(2);  // shorter than the rig: the third is solved
  held.cam_from_rig[0] = initial.cameras[0].cam_from_rig * held_from_initial.Inverse();
  held.cam_from_rig[1] = initial.cameras[1].cam_from_rig * held_from_initial.Inverse();
  BundleProblem problem = initial;
  MoveToHeld(held, &problem);
  for (size_t c = 0; c < 3; ++c) {
    const RigidTransform expected = initial.cameras[c].cam_from_rig * held_from_initial.Inverse();
    const RigidTransform& pose = problem.cameras[c].cam_from_rig;
    EXPECT_LT(pose.rotation.angularDistance(expected.rotation), 1e-7);
    EXPECT_LT((pose.translation_m - expected.translation_m).norm(), 1e-9);
  }
  for (size_t i = 0; i < initial.instants.size(); ++i) {
    EXPECT_TRUE(problem.instants[i].used);
    EXPECT_LT(
        (problem.instants[i].origin_m - held_from_initial * initial.instants[i].origin_m).norm(),
        1e-3);
  }
}

// The initialization has its errors: half of them before, half behind.
TEST(MoveToHeldTest, GoesBetweenCamerasThatContradictEachOther) {
  BundleProblem problem = ThreeCameras();
  HeldRig held;
  held.cam_from_rig.resize(3);
  for (const size_t c : {size_t{0}, size_t{1}}) {
    held.cam_from_rig[c] = problem.cameras[c].cam_from_rig;
    held.cam_from_rig[c]->translation_m.x() += c == 0 ? -0.01 : 0.03;
  }
  const RigidTransform before = problem.cameras[2].cam_from_rig;
  MoveToHeld(held, &problem);
  for (const size_t c : {size_t{0}, size_t{1}}) {
    EXPECT_EQ(problem.cameras[c].cam_from_rig.translation_m, held.cam_from_rig[c]->translation_m);
  }
  const Eigen::Vector3d moved =
      problem.cameras[2].cam_from_rig.translation_m - before.translation_m;
  EXPECT_LT((moved - Eigen::Vector3d(0.01, 0, 0)).norm(), 1e-9);
}

}  // namespace
}  // namespace rigcal::server::held_rig_test
