// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/bundle_problem.h"

#include <cmath>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

template <typename... Pieces>
absl::Status Fault(const Pieces&... pieces) {
  return absl::InvalidArgumentError(absl::StrCat("bundle adjustment: ", pieces...));
}

bool IsFinite(const RigidTransform& transform) {
  return transform.rotation.coeffs().allFinite() && transform.translation_m.allFinite();
}

bool IsRun(int first, int count, size_t size) {
  return first >= 0 && count >= 0 &&
         static_cast<size_t>(first) + static_cast<size_t>(count) <= size;
}

bool IsValid(const BundleDistance& distance, size_t camera_count) {
  const auto is_camera = [camera_count](int camera) {
    return camera >= 0 && static_cast<size_t>(camera) < camera_count;
  };
  return is_camera(distance.camera_a) && is_camera(distance.camera_b) &&
         distance.camera_a != distance.camera_b && std::isfinite(distance.distance_m) &&
         distance.distance_m > 0 && std::isfinite(distance.sigma_m) && distance.sigma_m > 0;
}

absl::Status ValidateCamera(const BundleCamera& camera) {
  const Eigen::Index size = IntrinsicsSize(camera.model);
  if (!IsFinite(camera.cam_from_rig) || !camera.intrinsics.allFinite()) {
    return Fault("camera ", camera.name, " has a value that is not finite");
  }
  if (camera.intrinsics.size() != size ||
      (!camera.intrinsics_fixed &&
       (camera.intrinsics_mean.size() != size || camera.intrinsics_sigma.size() != size))) {
    return Fault("camera ", camera.name, " needs ", size, " intrinsic values");
  }
  return absl::OkStatus();
}

absl::Status ValidateRigidTarget(const BundleRigidTarget& target) {
  for (const Eigen::Vector3d& point : target.points_m) {
    if (!point.allFinite()) return Fault("a point of the rigid target is not finite");
  }
  const size_t count = target.points_m.size();
  if (!target.fixed && (target.given_points_m.size() != count || target.sigma_m.size() != count)) {
    return Fault("the rigid target's points are to be estimated but have no prior");
  }
  return absl::OkStatus();
}

absl::Status ValidateInstant(const BundleProblem& problem, size_t index) {
  const BundleInstant& instant = problem.instants[index];
  const auto fault = [index](const char* what) { return Fault("instant ", index, " has ", what); };
  if (!instant.origin_m.allFinite() || !instant.direction.allFinite() ||
      !(std::abs(instant.direction.squaredNorm() - 1) <= 1e-6)) {
    return fault("no finite pose with a unit direction");
  }
  if (!(std::abs(instant.rotation.squaredNorm() - 1) <= 1e-6)) {
    return fault("a rotation that is not of unit length");
  }
  const size_t marker_count = instant.is_rigid ? problem.rigid_target.points_m.size()
                                               : problem.target.marker_positions_m.size();
  if (!IsRun(instant.first_observation, instant.observation_count, problem.observations.size())) {
    return fault("observations out of range");
  }
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    if (observation.camera < 0 ||
        static_cast<size_t>(observation.camera) >= problem.cameras.size() ||
        observation.clock < 0 || static_cast<size_t>(observation.clock) >= problem.clocks.size() ||
        !IsRun(observation.first_marker, observation.marker_count, problem.markers.size())) {
      return fault("an observation whose camera, clock or markers are out of range");
    }
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (marker.marker < 0 || static_cast<size_t>(marker.marker) >= marker_count) {
        return fault("a marker that the target does not have");
      }
      if (!marker.centre_px.allFinite() || !marker.velocity_px_s.allFinite() ||
          !marker.sqrt_information.allFinite()) {
        return fault("a marker with values that are not finite");
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<BundleWand> BundleTarget::Wands() const {
  return wands.empty() ? std::vector<BundleWand>{WandOf(0)} : wands;
}

BundleWand BundleTarget::WandOf(int marker) const {
  for (const BundleWand& wand : wands) {
    if (marker >= wand.first && marker < wand.end) return wand;
  }
  return {0, static_cast<int>(marker_positions_m.size()), span_sigma_m};
}

std::vector<std::pair<int, int>> BundleRigidTarget::Parts() const {
  std::vector<std::pair<int, int>> parts;
  for (const int first : first_points) {
    if (!parts.empty()) parts.back().second = first;
    parts.emplace_back(first, static_cast<int>(points_m.size()));
  }
  if (parts.empty()) parts.emplace_back(0, static_cast<int>(points_m.size()));
  return parts;
}

absl::Status BundleProblem::Validate() const {
  bool any_fixed = false;
  for (const BundleCamera& camera : cameras) {
    if (absl::Status status = ValidateCamera(camera); !status.ok()) return status;
    any_fixed = any_fixed || camera.pose_fixed;
    if (!std::isfinite(camera.line_delay_s) || !std::isfinite(camera.middle_row)) {
      return Fault("camera ", camera.name, " has a line delay that is not finite");
    }
  }
  if (!any_fixed) return Fault("no camera's pose is fixed");
  bool offset_fixed = clocks.empty(), rate_fixed = clocks.empty();
  for (const BundleClock& clock : clocks) {
    if (!std::isfinite(clock.time_offset_s) || !std::isfinite(clock.time_rate)) {
      return Fault("clock ", clock.clock_id, " has a value that is not finite");
    }
    offset_fixed = offset_fixed || clock.offset_fixed;
    rate_fixed = rate_fixed || clock.rate_fixed;
  }
  if (!offset_fixed || !rate_fixed) return Fault("no clock is fixed");
  for (const double position : target.marker_positions_m) {
    if (!std::isfinite(position)) return Fault("a marker position is not finite");
  }
  if (!target.fixed && (target.given_positions_m.size() != target.marker_positions_m.size() ||
                        !(target.span_sigma_m > 0))) {
    return Fault("the target's spacing is to be estimated but has no prior");
  }
  if (absl::Status status = ValidateRigidTarget(rigid_target); !status.ok()) return status;
  if (distance && !IsValid(*distance, cameras.size())) {
    return Fault(
        "the distance that holds the scale is not between two cameras, or it or "
        "its sigma is not positive");
  }
  for (size_t i = 0; i < instants.size(); ++i) {
    if (absl::Status status = ValidateInstant(*this, i); !status.ok()) return status;
  }
  return absl::OkStatus();
}

std::vector<Intrinsics> CurrentIntrinsics(const BundleProblem& problem) {
  std::vector<Intrinsics> intrinsics;
  for (const BundleCamera& camera : problem.cameras) {
    intrinsics.push_back(FromVector(camera.model, camera.intrinsics));
  }
  return intrinsics;
}

absl::Status BundleOptions::Validate() const {
  for (const double value :
       {loss_scale, function_tolerance, gradient_tolerance, parameter_tolerance, initial_radius}) {
    if (!std::isfinite(value) || value <= 0) {
      return Fault("loss scale, tolerances and the trust region's radius must be positive");
    }
  }
  if (max_iterations < 0) return Fault("max_iterations must not be negative");
  return absl::OkStatus();
}

}  // namespace rigcal::server
