// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/simulation/world/simulated_world.h"
#include "server/solve/rig/rig_solution.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/accuracy/rig/rig_information.h"
#include "tests/accuracy/rig/statistics.h"

namespace rigcal::accuracy {

enum class RigParameterKind : uint8_t {
  kRotation,        // vector in the camera frame
  kPosition,        // of the camera's centre, in the rig frame of the reference camera
  kMarkerPosition,  // `camera` is the marker
  kTimeOffset,      // against the reference camera's clock, seconds
  kTimeRate,        // against the reference camera's clock, s/s
  kLineDelay,       // seconds
  kIntrinsic,
};

struct RigParameter {
  RigParameterKind kind = RigParameterKind::kRotation;
  int camera = 0;  // of the world
  int component = 0;
};

// Joint covariance of all parameters except the instants, with the reference camera's pose and
// clock fixed.
struct RigCovariance {
  std::vector<RigParameter> parameters;
  Eigen::MatrixXd matrix;
};

RigCovariance FromBound(const RigBound& bound, const InformationOptions& options);

// Which of the solver's covariances: the one that it states, which allows for errors that
// neighbouring instants have in common, or the one of independent noise.
enum class SolverCovariance : uint8_t { kStated, kOfNoise };

// The solver's own covariance (uncertainty.h), scale included. One session, a clock for each
// camera.
absl::StatusOr<RigCovariance> FromSolution(const SimulatedWorld& world,
                                           const server::RigSolution& solution,
                                           SolverCovariance which = SolverCovariance::kStated);

// Normalised errors squared, by part. Parameters not estimated have no degrees of freedom.
struct RigNees {
  Nees shape;  // all rotations and positions, without the common scale of the positions
  Nees scale;  // that common scale
  Nees marker_positions;
  Nees time_offsets;
  Nees time_rates;
  Nees line_delays;
  Nees intrinsics;
};
RigNees NormaliseErrors(const CalibrationErrors& errors, const RigCovariance& covariance);

}  // namespace rigcal::accuracy
