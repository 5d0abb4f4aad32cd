// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/held_rig.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cstddef>

#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/initialize/initialization.h"

namespace rigcal::server {

void MoveToHeld(const HeldRig& held, BundleProblem* problem) {
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    if (!held.Holds(c)) continue;
    turns +=
        (held.cam_from_rig[c]->rotation.conjugate() * problem->cameras[c].cam_from_rig.rotation)
            .toRotationMatrix();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  const Eigen::Quaterniond turn(Eigen::Matrix3d(
      svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose()));
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  int count = 0;
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    if (!held.Holds(c)) continue;
    shift += held.cam_from_rig[c]->SourceFromTargetTranslation() -
             turn * problem->cameras[c].cam_from_rig.SourceFromTargetTranslation();
    ++count;
  }
  const RigidTransform held_from_initial(turn, shift / std::max(1, count));
  for (size_t c = 0; c < problem->cameras.size(); ++c) {
    RigidTransform& pose = problem->cameras[c].cam_from_rig;
    pose = held.Holds(c) ? *held.cam_from_rig[c] : pose * held_from_initial.Inverse();
  }
  // Their poses are found anew.
  for (BundleInstant& instant : problem->instants) instant.used = false;
  PlaceInstants(kAgreePx, problem);
}

}  // namespace rigcal::server
