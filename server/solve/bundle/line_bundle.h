// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/envelope_matrix.h"

namespace rigcal::server {

// Solves the problem in place: Levenberg-Marquardt for the line target alone. Every instant's 5x5
// block is eliminated as soon as it is accumulated, its coupling to the cameras is recomputed
// instead of kept, and eight instants go through the same instructions side by side. Reaches the
// optimum of SolveBundle (bundle_adjuster.h), which stays the reference for it; the damping and the
// stopping rules are Ceres's. Sums in a fixed order: equal problems give equal bits, whatever
// vector instructions the CPU has.
//
// A step that would put a used marker behind its camera (or onto a pole of the rational model) is
// rejected, like one that raises the cost.
//
// INVALID_ARGUMENT: the problem or the options are not valid, it has a rigid target, or the target
// has more than 32 markers. FAILED_PRECONDITION: no marker is used; a used marker is not visible at
// the initial values (names camera, instant and marker); the linear system broke down. CANCELLED.
// On an error the problem is left as it was. Not reaching the tolerance is no error: see
// `converged`.
absl::StatusOr<BundleSummary> SolveLineBundle(const BundleOptions& options, BundleProblem* problem);

// One column of the reduced system. Steps are added, except a rotation's, which is a rotation
// vector in the camera's frame applied from the left: exp([step]x) * rotation.
enum class ReducedParameterKind : uint8_t {
  kRotation,        // of cameras[index].cam_from_rig, component 0 to 2, radians
  kTranslation,     // of cameras[index].cam_from_rig, component 0 to 2, metres
  kIntrinsic,       // cameras[index].intrinsics[component]
  kTimeOffset,      // clocks[index].time_offset_s
  kTimeRate,        // clocks[index].time_rate
  kLineDelay,       // cameras[index].line_delay_s
  kMarkerPosition,  // target.marker_positions_m[index], metres
  kTargetPoint,     // rigid_target.points_m[index], component 0 to 2, metres
};

struct ReducedParameter {
  ReducedParameterKind kind = ReducedParameterKind::kRotation;
  int index = 0;
  int component = 0;
  friend bool operator==(const ReducedParameter&, const ReducedParameter&) = default;
};

struct ReducedInformation {
  std::vector<ReducedParameter> parameters;  // free ones; those that no used marker touches are not
  Eigen::MatrixXd information;               // symmetric; its inverse is their covariance
  Eigen::VectorXd gradient;                  // of the cost; on the general path without the priors
};

// The information about everything but the instants at the problem's present estimates: the
// Gauss-Newton matrix with the robust loss's weights and the priors, the instants eliminated; and
// the gradient, likewise.
// Errors as of SolveLineBundle.
absl::StatusOr<ReducedInformation> ComputeReducedInformation(const BundleOptions& options,
                                                             const BundleProblem& problem);

// One Gauss-Newton step of everything but the instants, and of the inverse of its information the
// blocks of parameters that an instant or a camera couples: of a large sparse problem no more than
// its envelope is ever kept.
struct ReducedStep {
  std::vector<ReducedParameter> parameters;
  Eigen::VectorXd step;
  EnvelopeMatrix covariance;
};
// Errors as of SolveLineBundle; FAILED_PRECONDITION where a parameter is not determined.
absl::StatusOr<ReducedStep> ComputeReducedStep(const BundleOptions& options,
                                               const BundleProblem& problem);

}  // namespace rigcal::server
