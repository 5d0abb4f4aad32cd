// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "common/geometry/rigid_transform.h"

namespace rigcal {

// The plane nearest to points.
struct PlaneFit {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  // Root mean square of the points from the centre along the longest direction, the one across it
  // and the normal; without weights.
  Eigen::Vector3d spread_m = Eigen::Vector3d::Zero();
};
// By weighted squared distances. At least one point.
PlaneFit FitPlane(const std::vector<Eigen::Vector3d>& points_m, const std::vector<double>& weights);

// new_from_rig of a floor `height_m` below its points: z is its normal on the side of `inside`, the
// origin is below point `first`, x points from there towards point `second`.
RigidTransform FloorFrame(const std::vector<Eigen::Vector3d>& points_m,
                          const std::vector<double>& weights, size_t first, size_t second,
                          double height_m, const Eigen::Vector3d& inside);

// b_from_a that brings points a nearest to points b by weighted squared distances (Kabsch 1976;
// Umeyama 1991, without scale); never a mirror image.
RigidTransform AlignPoints(const std::vector<Eigen::Vector3d>& a_m,
                           const std::vector<Eigen::Vector3d>& b_m,
                           const std::vector<double>& weights);

using FrameOfPoints = std::function<RigidTransform(const std::vector<Eigen::Vector3d>& points_m)>;
// Rotation vector from the left and translation, by each coordinate of each point.
using FrameDerivatives = Eigen::Matrix<double, 6, Eigen::Dynamic>;
// Central differences.
FrameDerivatives Differentiate(const FrameOfPoints& frame_of,
                               const std::vector<Eigen::Vector3d>& points_m);

// Rotation vector and translation by which `b` differs from `a`: b = exp(rotation) * a.
Eigen::Matrix<double, 6, 1> FrameDifference(const RigidTransform& a, const RigidTransform& b);

}  // namespace rigcal
