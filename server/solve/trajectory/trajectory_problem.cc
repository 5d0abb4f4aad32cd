// SPDX-License-Identifier: Apache-2.0
#include "server/solve/trajectory/trajectory_problem.h"

#include <cmath>

#include "common/camera/camera_model.h"
#include "common/status/status_macros.h"

namespace rigcal::server {

std::optional<Eigen::Vector2d> TrajectoryProblem::WhitenedResidual(
    size_t row, const BundleObservation& observation, const BundleMarker& marker) const {
  if (span_of_row[row] < 0) return std::nullopt;
  const TrajectorySpan& span = spans[static_cast<size_t>(span_of_row[row])];
  const TrajectoryPose pose = PoseAt(span, WeightsAt(span, TimeOf(observation, marker)));
  const double position_m = rows.target.marker_positions_m[static_cast<size_t>(marker.marker)];
  const BundleCamera& camera = rows.CameraOf(observation);
  Eigen::Vector2d pixel;
  if (!Project(camera.model, camera.intrinsics.data(),
               camera.cam_from_rig * (pose.origin_m + position_m * pose.direction), &pixel, nullptr,
               nullptr)) {
    return std::nullopt;
  }
  return marker.sqrt_information * (pixel - marker.centre_px);
}

absl::Status TrajectoryProblem::Validate() const {
  RIGCAL_RETURN_IF_ERROR(rows.Validate());
  if (rows.HasRigidTarget()) {
    return absl::InvalidArgumentError("trajectory: rigid targets are not supported");
  }
  if (time_s.size() != rows.markers.size() || span_of_row.size() != rows.instants.size()) {
    return absl::InvalidArgumentError("trajectory: a time or a span is missing");
  }
  for (const TrajectorySpan& span : spans) {
    if ((span.size != TrajectorySpan::kPointSize && span.size != TrajectorySpan::kLineSize) ||
        span.knots.size() % span.size != 0 || span.knot_count() < 4 || !(span.step_s > 0) ||
        !std::isfinite(span.begin_s) || !span.knots.allFinite()) {
      return absl::InvalidArgumentError("trajectory: a span without four finite knots");
    }
  }
  for (size_t row = 0; row < span_of_row.size(); ++row) {
    const BundleInstant& instant = rows.instants[row];
    if (instant.is_rigid || instant.observation_count != 1 ||
        span_of_row[row] >= static_cast<int>(spans.size())) {
      return absl::InvalidArgumentError("trajectory: a row of several cameras, or without span");
    }
  }
  if (!(origin_sigma > 0) || !(direction_sigma > 0)) {
    return absl::InvalidArgumentError("trajectory: the sigmas must be positive");
  }
  return absl::OkStatus();
}

}  // namespace rigcal::server
