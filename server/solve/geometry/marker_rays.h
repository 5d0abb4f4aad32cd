// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/camera/intrinsics.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/geometry/triangulation.h"

namespace rigcal::server {

// Normalised coordinates without distortion of each marker of a problem (same index), NaN where the
// camera's model has no inverse. With the problem's current intrinsics; the markers' own time shift
// is not applied.
std::vector<Eigen::Vector2d> UndistortMarkers(const BundleProblem& problem);

// The same for the markers of one instant, into `rays`; `intrinsics` by camera.
void UndistortInstant(const BundleProblem& problem, const std::vector<Intrinsics>& intrinsics,
                      const BundleInstant& instant, std::vector<Eigen::Vector2d>* rays);

// A used marker as its camera saw it at the instant's time: moved along its image motion by what
// its clock is off.
struct MarkerRay {
  int camera;
  int marker;                 // of the target
  Eigen::Vector2d centre_px;  // distorted
  CameraRay ray;              // undistorted, weighted by its stated covariance
  bool has_ray;               // false: the camera's model has no inverse there, the ray is zero
};

// Of one instant, whether it is used or not, in the order of its observations. `intrinsics` by
// camera, see CurrentIntrinsics. `cameras`: only of these, by camera; null: of all.
std::vector<MarkerRay> UsedMarkerRays(const BundleProblem& problem,
                                      const std::vector<Intrinsics>& intrinsics,
                                      const BundleInstant& instant,
                                      const std::vector<bool>* cameras = nullptr);

}  // namespace rigcal::server
