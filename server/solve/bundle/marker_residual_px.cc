// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/marker_residual_px.h"

#include <cmath>

#include "common/camera/camera_model.h"

namespace rigcal::server {

MeasuredMarker<double> ToMeasured(const BundleMarker& marker) {
  MeasuredMarker<double> measured = {0,
                                     0,
                                     0,
                                     {marker.centre_px.x(), marker.centre_px.y()},
                                     {marker.velocity_px_s.x(), marker.velocity_px_s.y()}};
  const Eigen::Matrix2d& root = marker.sqrt_information;
  const double norm = std::hypot(root(0, 0), root(1, 0));
  if (norm == 0) {
    measured.c = std::hypot(root(0, 1), root(1, 1));
    return measured;
  }
  const double cosine = root(0, 0) / norm, sine = root(1, 0) / norm;
  measured.a = norm;
  measured.b = cosine * root(0, 1) + sine * root(1, 1);
  measured.c = std::abs(cosine * root(1, 1) - sine * root(0, 1));
  return measured;
}

Eigen::Vector2d CentreAtInstantPx(const BundleProblem& problem,
                                  const BundleObservation& observation,
                                  const BundleMarker& marker) {
  return marker.centre_px - problem.TimeShiftS(observation, marker) * marker.velocity_px_s;
}

std::optional<Eigen::Vector2d> MarkerResidualPx(const BundleProblem& problem,
                                                const BundleInstant& instant,
                                                const BundleObservation& observation,
                                                const BundleMarker& marker) {
  const BundleCamera& camera = problem.CameraOf(observation);
  Eigen::Vector2d pixel;
  if (!Project(camera.model, camera.intrinsics.data(),
               camera.cam_from_rig * problem.PointOf(instant, marker), &pixel, nullptr, nullptr)) {
    return std::nullopt;
  }
  return pixel - CentreAtInstantPx(problem, observation, marker);
}

}  // namespace rigcal::server
