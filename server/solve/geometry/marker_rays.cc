// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/marker_rays.h"

#include <limits>

#include "common/camera/camera_model.h"
#include "server/solve/bundle/marker_residual_px.h"

namespace rigcal::server {

void UndistortInstant(const BundleProblem& problem, const std::vector<Intrinsics>& intrinsics,
                      const BundleInstant& instant, std::vector<Eigen::Vector2d>* rays) {
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      const absl::StatusOr<Eigen::Vector2d> ray =
          Undistort(intrinsics[static_cast<size_t>(observation.camera)], marker.centre_px);
      (*rays)[problem.IndexOf(marker)] =
          ray.ok() ? *ray : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    }
  }
}

std::vector<Eigen::Vector2d> UndistortMarkers(const BundleProblem& problem) {
  std::vector<Eigen::Vector2d> rays(problem.markers.size());
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  for (const BundleInstant& instant : problem.instants) {
    UndistortInstant(problem, intrinsics, instant, &rays);
  }
  return rays;
}

std::vector<MarkerRay> UsedMarkerRays(const BundleProblem& problem,
                                      const std::vector<Intrinsics>& intrinsics,
                                      const BundleInstant& instant,
                                      const std::vector<bool>* cameras) {
  std::vector<MarkerRay> views;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    const auto camera = static_cast<size_t>(observation.camera);
    if (cameras != nullptr && !(*cameras)[camera]) continue;
    const double fx_fy = intrinsics[camera].fx_px * intrinsics[camera].fy_px;
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      const Eigen::Vector2d centre_px = CentreAtInstantPx(problem, observation, marker);
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics[camera], centre_px);
      const Eigen::Vector2d plane = ray.ok() ? *ray : Eigen::Vector2d::Zero();
      views.push_back({observation.camera,
                       marker.marker,
                       centre_px,
                       {problem.cameras[camera].cam_from_rig, plane,
                        fx_fy * 0.5 * marker.sqrt_information.squaredNorm()},
                       ray.ok()});
    }
  }
  return views;
}

}  // namespace rigcal::server
