// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/inlier_views.h"

#include "common/camera/camera_model.h"
#include "server/solve/bundle/bundle_adjuster.h"

namespace rigcal::server {

std::vector<InlierView> InlierViews(const BundleProblem& problem,
                                    const std::vector<Intrinsics>& intrinsics,
                                    const BundleInstant& instant) {
  std::vector<InlierView> views;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    const auto camera = static_cast<size_t>(observation.camera);
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      const Eigen::Vector2d centre_px = CentreAtInstantPx(problem, observation, marker);
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics[camera], centre_px);
      const Eigen::Vector2d plane = ray.ok() ? *ray : Eigen::Vector2d::Zero();
      views.push_back({observation.camera,
                       marker.marker,
                       centre_px,
                       {problem.cameras[camera].cam_from_rig, plane},
                       ray.ok()});
    }
  }
  return views;
}

}  // namespace rigcal::server
