// SPDX-License-Identifier: Apache-2.0
#include "server/solve/bundle/line_bundle.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/envelope_cholesky.h"
#include "server/solve/bundle/line_bundle_system.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/bundle/target_scale.h"

namespace rigcal::server {
namespace {

constexpr double kMinRelativeDecrease = 1e-3;
constexpr double kMinRadius = 1e-32;
constexpr double kNear = 2e-3;  // relative change of the cost

// The radius of Ceres's Levenberg-Marquardt (after Nielsen 1999): the damping is its inverse.
class TrustRegion {
 public:
  explicit TrustRegion(double radius) : radius_(radius) {}
  double damping() const { return 1 / radius_; }
  bool exhausted() const { return radius_ < kMinRadius; }
  void Accept(double quality) {
    const double turned = 2 * quality - 1;
    radius_ = std::min(1e16, radius_ / std::max(1.0 / 3, 1 - turned * turned * turned));
    decrease_ = 2;
  }
  void Reject() {
    radius_ /= decrease_;
    decrease_ *= 2;
  }

 private:
  double radius_;
  double decrease_ = 2;
};

absl::Status CheckInput(const BundleOptions& options, const BundleProblem& problem) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  RIGCAL_RETURN_IF_ERROR(problem.Validate());
  const BundleTarget& target = problem.target;
  if (problem.HasRigidTarget()) {
    return absl::InvalidArgumentError(
        "bundle adjustment: the line kernel cannot solve a rigid target");
  }
  if (problem.HasSeveralWands() && !target.fixed) {
    return absl::InvalidArgumentError(
        "bundle adjustment: the line kernel cannot estimate several wands");
  }
  if (target.marker_positions_m.size() > kMaxLineMarkers) {
    return absl::InvalidArgumentError(
        absl::StrCat("bundle adjustment: the target has ", target.marker_positions_m.size(),
                     " markers, at most ", kMaxLineMarkers, " can be solved"));
  }
  return absl::OkStatus();
}

// Names the first used marker that its camera cannot see.
absl::Status UnseenMarker(const BundleProblem& problem) {
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used) continue;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      for (const BundleMarker& marker : problem.MarkersOf(observation)) {
        if (!marker.used || MarkerResidualPx(problem, instant, observation, marker)) continue;
        return absl::FailedPreconditionError(
            absl::StrCat("bundle adjustment: marker ", marker.marker, " of instant ", i,
                         " lies behind camera ", problem.CameraOf(observation).name,
                         " at the initial values; leave it out or initialize differently"));
      }
    }
  }
  return absl::FailedPreconditionError(
      "bundle adjustment: the initial cost is not finite; a marker lies next to its camera's "
      "image plane or its centre is absurdly far away");
}

class Solver {
 public:
  Solver(const BundleOptions& options, const BundleProblem& problem)
      : options_(options),
        layout_(LayOut(problem)),
        packed_(Pack(problem, layout_)),
        system_(options, layout_, packed_, BestLineBundleKernel()),
        estimate_(problem, layout_, packed_),
        moved_(problem, layout_, packed_),
        region_(options.initial_radius) {}

  const LineBundleLayout& layout() const { return layout_; }
  const LineBundleEstimate& estimate() const { return estimate_; }
  LineBundleSystem& system() { return system_; }
  bool empty() const { return packed_.instants.empty(); }
  void Store(BundleProblem* problem) const { estimate_.Store(packed_, problem); }

  // `summary` has its costs at the start.
  absl::Status Run(BundleSummary* summary);

 private:
  enum class Outcome { kGoOn, kConverged, kGivenUp, kBroken };

  Outcome Iterate(BundleSummary* summary);
  Outcome Accept(const LineBundleSystem::Move& move, BundleSummary* summary);

  const BundleOptions& options_;
  LineBundleLayout layout_;
  PackedMarkers packed_;
  LineBundleSystem system_;
  LineBundleEstimate estimate_, moved_;
  TrustRegion region_;
  bool near_ = false;  // the minimum: the loss's second derivative is worth following
};

Solver::Outcome Solver::Accept(const LineBundleSystem::Move& move, BundleSummary* summary) {
  const double cost = summary->final_cost;
  const double change = cost - move.cost;
  const bool small_step =
      move.step_norm <= options_.parameter_tolerance * (move.norm + options_.parameter_tolerance);
  const bool small_change = std::abs(change) <= options_.function_tolerance * cost;
  const double quality = change / move.model_decrease;
  if (quality > kMinRelativeDecrease || ((small_step || small_change) && change > 0)) {
    std::swap(estimate_, moved_);
    summary->final_cost = move.cost;
    region_.Accept(quality);
    near_ = change <= kNear * cost;
  } else {
    region_.Reject();
    near_ = false;
  }
  return small_step || small_change ? Outcome::kConverged : Outcome::kGoOn;
}

Solver::Outcome Solver::Iterate(BundleSummary* summary) {
  system_.Linearise(estimate_, region_.damping(), near_);
  if (system_.gradient_max() <= options_.gradient_tolerance) return Outcome::kConverged;
  ++summary->iterations;
  const LineBundleSystem::Move move = system_.Solve(estimate_, &moved_);
  if (move.valid && move.model_decrease > 0) {
    const Outcome outcome = Accept(move, summary);
    if (outcome != Outcome::kGoOn) return outcome;
  } else {
    region_.Reject();
  }
  if (!region_.exhausted()) return Outcome::kGoOn;
  // No step lowers the cost any more.
  return move.valid ? Outcome::kGivenUp : Outcome::kBroken;
}

absl::Status Solver::Run(BundleSummary* summary) {
  while (summary->iterations < options_.max_iterations) {
    if (options_.cancelled != nullptr && options_.cancelled->load()) {
      return absl::CancelledError("the calibration was cancelled");
    }
    const Outcome outcome = Iterate(summary);
    if (outcome == Outcome::kBroken) {
      return absl::FailedPreconditionError(
          "bundle adjustment: the linear system cannot be solved however small the step; some "
          "camera or clock is held by no observation");
    }
    summary->converged = outcome == Outcome::kConverged;
    if (options_.progress) options_.progress(summary->iterations, summary->final_cost);
    if (outcome != Outcome::kGoOn) break;
  }
  return absl::OkStatus();
}

// Calls function(solver) for a problem that can be solved; what is thrown becomes INTERNAL.
template <typename Result, typename Function>
absl::StatusOr<Result> WithSolver(const BundleOptions& options, const BundleProblem& problem,
                                  const Function& function) {
  RIGCAL_RETURN_IF_ERROR(CheckInput(options, problem));
  try {
    Solver solver(options, problem);
    if (solver.empty()) {
      return absl::FailedPreconditionError("bundle adjustment: no marker is used");
    }
    return function(solver);
  } catch (const std::bad_alloc&) {
    throw;  // no fault of this problem
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("bundle adjustment: ", error.what()));
  }
}

}  // namespace

absl::StatusOr<BundleSummary> SolveLineBundle(const BundleOptions& options,
                                              BundleProblem* problem) {
  const auto solve = [problem](Solver& solver) -> absl::StatusOr<BundleSummary> {
    BundleSummary summary;
    summary.initial_cost = summary.final_cost = solver.system().Cost(solver.estimate());
    if (!std::isfinite(summary.initial_cost)) return UnseenMarker(*problem);
    RIGCAL_RETURN_IF_ERROR(solver.Run(&summary));
    solver.Store(problem);
    summary.final_cost -= SettleScale(problem).gain;
    return summary;
  };
  return WithSolver<BundleSummary>(options, *problem, solve);
}

absl::StatusOr<ReducedInformation> ComputeReducedInformation(const BundleOptions& options,
                                                             const BundleProblem& problem) {
  const auto compute = [&problem](Solver& solver) -> absl::StatusOr<ReducedInformation> {
    if (!solver.system().Linearise(solver.estimate(), 0, false)) return UnseenMarker(problem);
    return ReducedInformation{solver.layout().parameters, solver.system().matrix().Symmetric(),
                              solver.system().reduced_gradient()};
  };
  return WithSolver<ReducedInformation>(options, problem, compute);
}

absl::StatusOr<ReducedStep> ComputeReducedStep(const BundleOptions& options,
                                               const BundleProblem& problem) {
  const auto compute = [&problem](Solver& solver) -> absl::StatusOr<ReducedStep> {
    if (!solver.system().Linearise(solver.estimate(), 0, false)) return UnseenMarker(problem);
    const EnvelopeCholesky factor(solver.system().matrix());
    if (!factor.ok()) {
      return absl::FailedPreconditionError("bundle adjustment: a parameter is not determined");
    }
    return ReducedStep{solver.layout().parameters,
                       -factor.Solve(solver.system().reduced_gradient()), factor.InverseWithin()};
  };
  return WithSolver<ReducedStep>(options, problem, compute);
}

}  // namespace rigcal::server
