// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/camera/intrinsics_vector.h"
#include "common/geometry/rigid_transform.h"

namespace rigcal::server {

// The spatio-temporal bundle adjustment of a target seen by many cameras; of a line target:
//
//   minimise  1/2 sum over used markers of rho( |r|^2 )  +  1/2 sum of priors
//   r = L * (p - (u - dt * u')),   p = pi(K_c, cam_from_rig_c * (origin_k + s_m * direction_k))
//
// or, of an instant that shows a rigid target, p = pi(K_c, cam_from_rig_c * (R_k * x_m +
// origin_k)), with u the measured centre at the instant's time under the clock alignment the
// problem was built with, u' its image velocity, L^T L the inverse of u's covariance, s_m the
// marker's position along the target, and
//   dt = time_offset_s + time_rate * clock_time_s + line_delay_s * (u_y - middle_row)
// what the camera's clock is still off at the marker's image row (same sense as in Clock: negative
// where rows show an earlier time than their stamps say).
//
// What to solve (BundleProblem, estimates are changed in place), how (BundleOptions) and what came
// out (BundleSummary) are three structs. Everything refers by index; instants own a contiguous run
// of observations, observations a contiguous run of markers.

struct BundleCamera {
  std::string name;
  RigidTransform cam_from_rig;
  bool pose_fixed = false;  // the gauge: one camera of a problem, at least

  DistortionModel model = DistortionModel::kBrownConrady;
  IntrinsicsVector intrinsics;  // 4 + CoefficientCount(model) values
  bool intrinsics_fixed = true;
  // Independent normal priors on refined intrinsics. sigma 0 holds that value fixed.
  IntrinsicsVector intrinsics_mean;
  IntrinsicsVector intrinsics_sigma;

  // Rolling shutter: correction on top of the times that the rows of the observations have, from
  // one image row to the next. The middle row's time is the clock's.
  double line_delay_s = 0;
  bool line_delay_fixed = true;
  double middle_row = 0;
  // Normal prior around prior_line_delay_s; sigma 0 means none.
  double prior_line_delay_s = 0;
  double line_delay_sigma_s = 0;
};

struct BundleClock {
  std::string clock_id;
  double time_offset_s = 0;  // correction on top of the alignment of the observations
  double time_rate = 0;      // s/s, likewise
  bool offset_fixed = true;  // one clock of a problem is fixed, else time has no origin
  bool rate_fixed = true;
  // Normal priors around prior_*; sigma 0 means none.
  double prior_offset_s = 0;
  double offset_sigma_s = 0;
  double prior_rate = 0;
  double rate_sigma = 0;
};

// One wand of a line target: its markers from the first to behind the last.
struct BundleWand {
  int first = 0, end = 0;
  double span_sigma_m = 0.002;  // prior of each span between neighbours when estimated

  int Mirrored(int marker) const { return first + end - 1 - marker; }
};

// Sigma of the first marker of a further wand where the information has a row for it: it is held,
// because where a wand begins is a matter of its poses.
inline constexpr double kHeldMarkerSigmaM = 1e-6;

// It may be several wands that never show together: an instant shows one of them.
struct BundleTarget {
  // Along the target; the first of each wand is 0 and never moves.
  std::vector<double> marker_positions_m;
  bool fixed = true;
  // Prior of each span between neighbours when estimated: normal around the given span.
  std::vector<double> given_positions_m;
  double span_sigma_m = 0.002;
  std::vector<BundleWand> wands;  // one after the other; empty: it is one, with span_sigma_m

  std::vector<BundleWand> Wands() const;
  BundleWand WandOf(int marker) const;
};

// A rigid target: labelled points in a frame `target` of their own. Only bundle_adjuster.h solves
// problems that have one. It may have several parts that never show together: an instant has a pose
// for the one part that it shows, so that where the parts are to each other says nothing.
struct BundleRigidTarget {
  std::vector<Eigen::Vector3d> points_m;
  std::vector<int> first_points;  // of each part; empty: it is one
  bool fixed = true;
  // Prior of each coordinate of a point when estimated: normal around the given one. The priors
  // hold the frame `target` too. sigma 0 holds that point fixed.
  std::vector<Eigen::Vector3d> given_points_m;
  std::vector<double> sigma_m;

  bool IsFree(size_t point) const { return !fixed && sigma_m[point] > 0; }
  // The points of each part, from the first to behind the last.
  std::vector<std::pair<int, int>> Parts() const;
};

// Most of a problem's memory: not aligned, so that it holds nothing but its values.
struct BundleMarker {
  using Vector2 = Eigen::Matrix<double, 2, 1, Eigen::DontAlign>;
  using Matrix2 = Eigen::Matrix<double, 2, 2, Eigen::DontAlign>;

  Vector2 centre_px = Vector2::Zero();
  Vector2 velocity_px_s = Vector2::Zero();
  Matrix2 sqrt_information = Matrix2::Identity();  // L, 1/px
  int marker = 0;                                  // index into marker_positions_m
  bool used = true;  // false: no part of the cost (rejected), residual still of interest
};

struct BundleObservation {
  int camera = 0;
  int clock = 0;            // that stamped it; a camera may have another one in another session
  double clock_time_s = 0;  // of this observation on its clock, from the clock's time epoch
  int first_marker = 0;
  int marker_count = 0;
};

// Holds the scale where the target, with its one marker, has none: a normal prior on the distance
// between two cameras' centres. The scale is free of everything else, so the solution has this
// distance whatever the sigma, which only keeps the problem well conditioned.
struct BundleDistance {
  int camera_a = 0, camera_b = 0;
  double distance_m = 1;
  double sigma_m = 1e-4;
};

// A target at one time: marker m is at origin_m + marker_positions_m[m] * direction; of a rigid
// target at origin_m + rotation * points_m[m].
struct BundleInstant {
  using Quaternion = Eigen::Quaternion<double, Eigen::DontAlign>;

  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  // unit, 2 degrees of freedom
  Quaternion rotation = Quaternion::Identity();          // rig_from_target, unit
  bool is_rigid = false;                                 // the target is `rigid_target`
  bool is_point = false;  // a part of it that is one point: without a rotation to estimate
  int first_observation = 0;
  int observation_count = 0;
  bool used = true;  // false: no marker of it is part of the cost
};

struct BundleProblem {
  std::vector<BundleCamera> cameras;
  std::vector<BundleClock> clocks;
  BundleTarget target;
  BundleRigidTarget rigid_target;  // of the instants that say so
  std::vector<BundleInstant> instants;
  std::vector<BundleObservation> observations;
  std::vector<BundleMarker> markers;
  std::optional<BundleDistance> distance;

  // What the time of a marker is still off: dt above.
  double TimeShiftS(const BundleObservation& observation, const BundleMarker& marker) const {
    const BundleClock& clock = clocks[static_cast<size_t>(observation.clock)];
    const BundleCamera& camera = CameraOf(observation);
    return clock.time_offset_s + clock.time_rate * observation.clock_time_s +
           camera.line_delay_s * (marker.centre_px.y() - camera.middle_row);
  }
  // The runs that an instant and an observation own. What they refer to must be in range.
  std::span<const BundleObservation> ObservationsOf(const BundleInstant& instant) const {
    return {observations.data() + instant.first_observation,
            static_cast<size_t>(instant.observation_count)};
  }
  std::span<BundleObservation> ObservationsOf(const BundleInstant& instant) {
    return {observations.data() + instant.first_observation,
            static_cast<size_t>(instant.observation_count)};
  }
  std::span<const BundleMarker> MarkersOf(const BundleObservation& observation) const {
    return {markers.data() + observation.first_marker,
            static_cast<size_t>(observation.marker_count)};
  }
  std::span<BundleMarker> MarkersOf(const BundleObservation& observation) {
    return {markers.data() + observation.first_marker,
            static_cast<size_t>(observation.marker_count)};
  }
  const BundleCamera& CameraOf(const BundleObservation& observation) const {
    return cameras[static_cast<size_t>(observation.camera)];
  }
  // Where a marker is in the rig.
  Eigen::Vector3d PointOf(const BundleInstant& instant, const BundleMarker& marker) const {
    if (instant.is_rigid) {
      return instant.origin_m +
             instant.rotation * rigid_target.points_m[static_cast<size_t>(marker.marker)];
    }
    return instant.origin_m +
           target.marker_positions_m[static_cast<size_t>(marker.marker)] * instant.direction;
  }
  // Of the target with most.
  size_t MarkerCount() const {
    return std::max(target.marker_positions_m.size(), rigid_target.points_m.size());
  }
  // One marker alone: it has no lengths.
  bool IsPoint() const { return MarkerCount() == 1; }
  bool HasRigidTarget() const { return !rigid_target.points_m.empty(); }
  bool HasSeveralWands() const { return target.wands.size() > 1; }
  // Any instant shows a part of the rigid target whose pose one view gives.
  bool HasBody() const {
    return std::ranges::any_of(instants, [](const BundleInstant& instant) {
      return instant.is_rigid && !instant.is_point;
    });
  }
  // Of a marker of this problem.
  size_t IndexOf(const BundleMarker& marker) const {
    return static_cast<size_t>(&marker - markers.data());
  }

  // INVALID_ARGUMENT: an index out of range, a value that is not finite, no fixed camera, no fixed
  // clock while others are estimated, a target that is estimated without a prior, a distance that
  // is not positive or not between two cameras, a rotation that is not unit.
  absl::Status Validate() const;
};

// Of each camera, by index.
std::vector<Intrinsics> CurrentIntrinsics(const BundleProblem& problem);

// Calls function(observation, marker) for what of an instant is part of the cost.
template <typename Function>
void ForEachUsedMarker(const BundleProblem& problem, const BundleInstant& instant,
                       const Function& function) {
  if (!instant.used) return;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (marker.used) function(observation, marker);
    }
  }
}

struct BundleOptions {
  bool robust = true;       // Cauchy's loss; false: least squares
  double loss_scale = 2.0;  // in sigmas of a marker's centre, > 0
  int max_iterations = 100;
  double function_tolerance = 1e-10;   // relative change of the cost
  double gradient_tolerance = 1e-10;   // as in Ceres
  double parameter_tolerance = 1e-10;  // relative change of the parameters
  // Of the trust region: the inverse of the first step's damping. From values that an adjustment
  // has left, a larger one saves steps.
  double initial_radius = 1e4;
  // Called after each iteration from the solving thread, with the relative decrease of the cost.
  std::function<void(int iteration, double cost)> progress;
  const std::atomic<bool>* cancelled = nullptr;

  // Every fault: values not positive or not finite.
  absl::Status Validate() const;
};

struct BundleSummary {
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
  bool converged = false;
};

}  // namespace rigcal::server
