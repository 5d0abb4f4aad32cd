// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal::accuracy {

// Everything that determines how well a rig can be estimated from observations of a line target or
// a rigid one, at the ground truth.
struct TrueCamera {
  RigidTransform cam_from_rig;
  Intrinsics intrinsics;
  double middle_row = 0;  // whose time the camera's clock shows
};
struct SeenMarker {
  int camera = 0;
  int marker = 0;
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};
struct TrueInstant {
  WandPose wand;
  // How fast marker 0, or the origin of a rigid target, moves, and how fast the target turns; for
  // time offsets.
  Eigen::Vector3d origin_velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d turn_rad_s = Eigen::Vector3d::Zero();
  std::vector<SeenMarker> markers;
};
struct TrueRig {
  std::vector<TrueCamera> cameras;
  std::vector<double> marker_positions_m;
  std::vector<Eigen::Vector3d> points_m;  // of a rigid target; empty: a line target
  std::vector<TrueInstant> instants;
  int reference_camera = 0;  // its pose is known and its clock is the time
};

// Parameters estimated besides the poses of the cameras and of the target in every instant, with
// the sigmas of their priors (must be positive). With a rigid target no marker positions.
struct InformationOptions {
  bool marker_positions = false;
  double span_sigma_m = 0.002;
  bool time_offsets = false;         // of every camera but the reference, no prior
  bool line_delays = false;          // of every camera, no prior
  bool intrinsics = false;           // of every camera
  Eigen::VectorXd intrinsics_sigma;  // fx fy cx cy and the coefficients
};

// The Cramer-Rao bound: the inverse of the Fisher information of Gaussian centres, with the
// instants' five degrees of freedom (six of a rigid target) eliminated. Instants seen by fewer than
// two cameras are left out. With priors it is the bound for an average over ground truths drawn
// from them.
struct RigBound {
  // Of the parameters in this order: per camera but the reference three of its rotation (vector in
  // the camera frame) and three of its centre (rig frame, metres); the positions of markers 1, 2,
  // ...; per camera but the reference its time offset; per camera its line delay; per camera its
  // intrinsics.
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd information;  // its inverse
  int reference_camera = 0;
  int camera_count = 0;
  int first_marker_position = 0;  // index of the first of each group, valid if it is estimated
  int first_time_offset = 0;
  int first_line_delay = 0;
  int first_intrinsics = 0;

  // Index of the first of a camera's values; -1 for the reference.
  int PoseIndex(int camera) const;
  int TimeOffsetIndex(int camera) const;
  Eigen::Matrix3d PositionCovariance(int camera) const {
    return covariance.block<3, 3>(PoseIndex(camera) + 3, PoseIndex(camera) + 3);
  }
};

// INVALID_ARGUMENT: something that there is no bound of with a rigid target. FAILED_PRECONDITION:
// the observations do not determine the parameters, or a marker is behind its camera.
absl::StatusOr<RigBound> ComputeRigBound(const TrueRig& rig, const InformationOptions& options);
// The same without the covariance: of observations that alone need not determine the parameters.
absl::StatusOr<RigBound> ComputeRigInformation(const TrueRig& rig,
                                               const InformationOptions& options);
// The covariance from the information.
absl::Status FillCovariance(RigBound* bound);

// The true rig behind the frames of cameras that run together (equal rates, no free running, no
// flipped labels): what was visible and is no outlier. Poses in the rig frame of `reference`.
TrueRig MakeTrueRig(const SimulatedWorld& world, int reference);

// What is known of static points from these instants, which show them as a rigid target: of each
// camera one centre for each point. Surveyed they are one instant, else each point is one.
TrueRig GatherStaticInstants(const TrueRig& rig, bool is_surveyed);

}  // namespace rigcal::accuracy
