// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace rigcal {

// `target_from_source`: x_in_target = rotation * x_in_source + translation_m. Reads by adjacency:
//   a_from_c = a_from_b * b_from_c,   x_in_a = a_from_b * x_in_b.
struct RigidTransform {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();

  RigidTransform() = default;
  RigidTransform(const Eigen::Quaterniond& rotation_in, const Eigen::Vector3d& translation_in_m)
      : rotation(rotation_in), translation_m(translation_in_m) {}

  static RigidTransform Identity() { return {}; }

  RigidTransform Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, inverse * -translation_m};
  }
  // Where the source's origin would be seen from: for cam_from_rig, the camera's centre in the rig.
  Eigen::Vector3d SourceFromTargetTranslation() const {
    return rotation.conjugate() * -translation_m;
  }
  Eigen::Matrix4d Matrix() const {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() = rotation.toRotationMatrix();
    matrix.topRightCorner<3, 1>() = translation_m;
    return matrix;
  }
};

inline RigidTransform operator*(const RigidTransform& a_from_b, const RigidTransform& b_from_c) {
  return {(a_from_b.rotation * b_from_c.rotation).normalized(),
          a_from_b.rotation * b_from_c.translation_m + a_from_b.translation_m};
}

inline Eigen::Vector3d operator*(const RigidTransform& a_from_b, const Eigen::Vector3d& x_in_b) {
  return a_from_b.rotation * x_in_b + a_from_b.translation_m;
}

// The same rotation with w >= 0, the form in which quaternions leave the process.
inline Eigen::Quaterniond Canonical(const Eigen::Quaterniond& rotation) {
  return rotation.w() < 0 ? Eigen::Quaterniond(-rotation.coeffs()) : rotation;
}

}  // namespace rigcal
