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
  double weight = 1;  // of its squared error against those of the other rays: inverse variance
};

// A known point and its ray in a camera whose pose is looked for.
struct PointAndRay {
  Eigen::Vector3d x_in_rig;
  Eigen::Vector2d ray;
};

// The point that two or more views see, by the linear method (Hartley and Zisserman, Multiple View
// Geometry, section 12.2) followed by Gauss-Newton on the weighted normalised residuals. None with fewer
// than two views, where it is not before every camera, or where the rays are too parallel to meet.
std::optional<Eigen::Vector3d> Triangulate(const std::vector<CameraRay>& views);

// For each view the point that the others see: what Triangulate says of them, within a thousandth
// of a pixel, in a time that grows with the number of views and not with its square.
std::vector<std::optional<Eigen::Vector3d>> TriangulateWithoutEach(
    const std::vector<CameraRay>& views);

// As Triangulate for two views, linear method only.
std::optional<Eigen::Vector3d> TriangulatePair(const CameraRay& a, const CameraRay& b);

// |ray - image of the point|, normalised.
double RayError(const CameraRay& view, const Eigen::Vector3d& x_in_rig);

}  // namespace rigcal::server
