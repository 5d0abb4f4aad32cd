// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

// A camera's ray towards a point: normalised coordinates (x/z, y/z) without distortion.
struct CameraRay {
  RigidTransform cam_from_rig;
  Eigen::Vector2d ray;
};

// A known point and its ray in a camera whose pose is looked for.
struct PointAndRay {
  Eigen::Vector3d x_in_rig;
  Eigen::Vector2d ray;
};

// The point that two or more views see, by the linear method (Hartley and Zisserman, Multiple View
// Geometry, section 12.2) followed by Gauss-Newton on the normalised residuals. None with fewer
// than two views, where it is not before every camera, or where the rays are too parallel to meet.
std::optional<Eigen::Vector3d> Triangulate(const std::vector<CameraRay>& views);

// The same for two views, linear method only.
std::optional<Eigen::Vector3d> TriangulatePair(const CameraRay& a, const CameraRay& b);

// |ray - image of the point|, normalised.
double RayError(const CameraRay& view, const Eigen::Vector3d& x_in_rig);

}  // namespace rigcal::server
