// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "common/camera/intrinsics.h"

namespace rigcal {

// A sphere as a camera images it. Its outline is the cut of a circular cone about the ray to its
// centre, an ellipse whose centroid is not the projection of the sphere's centre.
struct SphereProjection {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();    // projection of the sphere's centre
  Eigen::Vector2d centroid_px = Eigen::Vector2d::Zero();  // of the image's area
  double area_px2 = 0;
};

// Images a sphere around `centre_in_cam_m`. The outline lies on the cone of half angle
// asin(radius / distance); area and centroid follow from integrals along it (Green's theorem), with
// any lens model. Without distortion and with unit focal length this is the closed form
//   centroid = (X, Y) Z / (Z^2 - radius^2)
// (eccentricity of spherical targets: Luhmann, 2014, Photogrammetric Record 29, 424-443). 0.13 px
// for 40 mm at 1.5 m, 600 px from the middle. False, and `image` untouched, where the camera does
// not see all of the sphere's outline. Allocates nothing.
bool ProjectSphere(const Intrinsics& intrinsics, const Eigen::Vector3d& centre_in_cam_m,
                   double diameter_m, SphereProjection* image);

// The way back: where a sphere's centre projects to whose image has its centroid at `centroid_px`
// and whose centre is `distance_m` away from the camera. False, and `centre_px` untouched, as
// above or where the lens has no ray.
bool SphereCentreFromCentroid(const Intrinsics& intrinsics, const Eigen::Vector2d& centroid_px,
                              double distance_m, double diameter_m, Eigen::Vector2d* centre_px);

}  // namespace rigcal
