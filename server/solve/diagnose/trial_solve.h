// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/solve/bundle/bundle_problem.h"
#include "server/solve/bundle/envelope_cholesky.h"
#include "server/solve/bundle/line_bundle.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"

namespace rigcal::server {

// A solved problem to try explanations on: a copy in which something more is allowed to move is
// solved again, and what that gains tells whether the explanation holds. Only placed instants, and
// only so many as such a test needs.
struct TrialProblem {
  BundleProblem problem;
  std::vector<int64_t> instant_time_ns;  // rig time, by instant, ascending within a session
  // By camera of the problem: its index in the rig. A camera taken apart has several.
  std::vector<size_t> rig_camera;
  BundleOptions bundle;
  bool shares_few = false;         // LooksAtLensesAlone (placed_views.h)
  std::vector<int> uneven_clocks;  // that no one offset and rate describes
};

// About 40 000 of the solution's observations: every n-th instant.
TrialProblem MakeTrialProblem(const RigSolution& solution, const RigSolveOptions& options);

// Leaves of the placed instants every n-th, about `max_observations` in all, and those of cameras
// that have less than their share.
void UseSome(size_t max_observations, BundleProblem* problem);

// Solves `problem`, finds the outliers anew, and solves again until they stay (a few times at
// most). Errors as of AdjustBundle; `problem` is then worth nothing.
absl::Status SolveTrial(const BundleOptions& how, BundleProblem* problem);

// The same, first under a loss so wide that what is far off pulls, too.
absl::Status SolveTrialFromAfar(const BundleOptions& how, BundleProblem* problem);

// Mean reprojection errors before and after, over the markers that are inliers in either.
struct ErrorChange {
  double before_px = 0;
  double after_px = 0;
  int marker_count = 0;

  double gain_px() const { return before_px - after_px; }
  // Share of the error that goes away.
  double gain() const { return before_px > 0 ? 1 - after_px / before_px : 0; }
};

// By camera of `before`. Both hold the same markers in the same order; a marker that its camera
// cannot see counts as 100 px off.
std::vector<ErrorChange> CompareErrors(const BundleProblem& before, const BundleProblem& after);
// Mean reprojection error of all markers, each at most `cap_px`.
double CappedErrorPx(const BundleProblem& problem, double cap_px);
// Of all cameras together.
ErrorChange Overall(const std::vector<ErrorChange>& changes);

// Uncertainty of the free parameters of a solved problem, from the information the data and priors
// give and the size of the residuals (where they are larger than the observations' sigmas say).
struct TrialSigmas {
  std::vector<ReducedParameter> parameters;
  Eigen::VectorXd variance;  // by parameter
  // Of the information whose parameters are in units of `unit`, which has a unit diagonal; the
  // covariance is `factor` times its inverse.
  EnvelopeCholesky information;
  Eigen::VectorXd unit;
  double factor = 1;

  // -1 for what is not free.
  Eigen::Index Row(const ReducedParameter& parameter) const;
  // One sigma; infinite for what is not free or not determined.
  double Of(const ReducedParameter& parameter) const;
  // How many sigmas the pose of camera `b` is from that of camera `a`: the Mahalanobis distance of
  // `difference` (rotation vector, translation) under the joint covariance of the two, which holds
  // what they have in common, such as their lens. 0: not determined.
  double PoseDistance(int a, int b, const Eigen::Matrix<double, 6, 1>& difference) const;
};
// `one_lens`: two cameras whose intrinsics are the same numbers.
absl::StatusOr<TrialSigmas> ComputeSigmas(
    const BundleOptions& how, const BundleProblem& problem,
    std::optional<std::pair<int, int>> one_lens = std::nullopt);

// Runs `visit(instant index, observation, marker index)` over the markers of the placed instants.
template <typename Visit>
void ForEachMarker(const BundleProblem& problem, Visit visit) {
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        visit(i, observation, problem.IndexOf(marker));
      }
    }
  }
}

}  // namespace rigcal::server
