// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/evaluated_solve.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/clocks/time_check.h"
#include "server/solve/evaluate/clock_rate_choice.h"
#include "server/solve/evaluate/fold_evaluation.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/evaluate/intrinsics_choice.h"
#include "server/solve/evaluate/lens_comparison.h"
#include "server/solve/evaluate/line_delay_choice.h"
#include "server/solve/evaluate/path_choice.h"
#include "server/solve/evaluate/placed_views.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/initialize/shared_views.h"
#include "server/solve/rig/outliers.h"
#include "server/solve/rig/put_away.h"
#include "server/solve/rig/rig_solver.h"
#include "server/solve/rig/trajectory_fit.h"

namespace rigcal::server {
namespace {

constexpr int kMaxTimeRepairs = 3;
constexpr double kMayLoseInliers = 0.05;  // of all markers
constexpr int kMinAgreeingViews = 8;      // of a camera; fewer hold no pose

// Restarts a solve from another offset of a clock that fits the other clocks' cameras much better
// there.
absl::Status RepairOffsets(const RigObservations& rig, const RigSolveOptions& options,
                           EvaluatedSolution* result) {
  for (int i = 0; i < kMaxTimeRepairs; ++i) {
    if (!result->solution.converged) {
      // Clocks that still move are on their way to where they match.
      const RigInitialization initial = InitializationFrom(result->solution);
      PutAway(rig, options, &result->solution);
      absl::StatusOr<RigSolution> further = SolveRig(rig, initial.clocks, options, &initial);
      if (absl::IsCancelled(further.status())) return further.status();
      if (further.ok()) result->solution = *std::move(further);
      TakeBack(rig, options, &result->solution);
    }
    const auto doubt = FindBetterOffset(rig, result->solution);
    if (!doubt) return absl::OkStatus();
    std::vector<ClockCorrection> clocks = InitializationFrom(result->solution).clocks;
    clocks[static_cast<size_t>(doubt->clock)].time_offset_s += doubt->offset_s;
    const double share = InlierShare(result->solution.built.problem);
    PutAway(rig, options, &result->solution);
    absl::StatusOr<RigSolution> again = SolveRig(rig, clocks, options);
    if (absl::IsCancelled(again.status())) return again.status();
    // Another time groups other views; only a fit that breaks is a reason to stay.
    if (!again.ok() || InlierShare(again->built.problem) < share - kMayLoseInliers) {
      again = absl::UnknownError("not taken");
      TakeBack(rig, options, &result->solution);
      return absl::OkStatus();
    }
    result->solution = *std::move(again);
    for (size_t t = 0; t < rig.tracks.size(); ++t) {
      if (rig.index.clock_of_track[t] != doubt->clock) continue;
      result->findings.push_back(
          {FindingKind::kTimeMatchCorrected, rig.tracks[t].track.camera.camera,
           1e3 * doubt->offset_s, "ms",
           absl::StrFormat("the search had matched its clock with another part of the motion: "
                           "against the other cameras it fitted to %.1f px, %.0f ms away to %.1f "
                           "px, and the rig was solved again from there. A motion that repeats "
                           "itself fits at several offsets: avoid periodic motion",
                           doubt->here_px, 1e3 * doubt->offset_s, doubt->there_px)});
      break;
    }
  }
  return absl::OkStatus();
}

// Times come first: markers of another time agree with no pose.
absl::Status LeaveWrongMinimum(const RigObservations& rig,
                               const std::vector<ClockCorrection>& clocks,
                               const RigSolveOptions& options, EvaluatedSolution* result) {
  // A wrong pose may have dragged its clock along; what a repair has found stays.
  const bool repaired = !result->findings.empty();
  RIGCAL_ASSIGN_OR_RETURN(
      const std::optional<Finding> restarted,
      RestartIfWrong(rig, repaired ? InitializationFrom(result->solution).clocks : clocks, options,
                     &result->solution));
  if (!restarted) return absl::OkStatus();
  result->findings.push_back(*restarted);
  return options.estimate_time_offsets ? RepairOffsets(rig, options, result) : absl::OkStatus();
}

// A camera that agrees with no other has a meaningless pose.
absl::Status CheckHeld(const BundleProblem& problem) {
  const std::string lost = DescribeLostCameras(problem, kMinAgreeingViews);
  if (lost.empty()) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat("the rig cannot be solved as one. ", lost));
}

// Names the rolling shutters of the solution, instead of those named before.
void NameRollingShutters(const RigObservations& rig, EvaluatedSolution* result) {
  std::erase_if(result->findings, [](const Finding& finding) {
    return finding.kind == FindingKind::kRollingShutter;
  });
  std::ranges::move(
      RollingShutterFindings(rig, result->options, result->solution, *result->uncertainty),
      std::back_inserter(result->findings));
}

// Follows the target through time in the end, and takes over what the folds say of that; what
// cannot be followed stays as it is.
absl::Status FollowTarget(const RigObservations& rig, FoldResults* folds,
                          EvaluatedSolution* result) {
  absl::StatusOr<RigSolution> followed =
      SolveOnTrajectory(rig, result->options, result->solution, folds->path.get());
  if (absl::IsCancelled(followed.status())) return followed.status();
  if (!followed.ok()) return absl::OkStatus();
  absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*followed, result->options);
  if (!uncertainty.ok()) return absl::OkStatus();
  result->solution = *std::move(followed);
  result->uncertainty = *std::move(uncertainty);
  if (folds->by_path.held_out.instant_count > 0) {
    result->held_out = std::move(folds->by_path.held_out);
    folds->by_instants.poses = std::move(folds->by_path.poses);
  }
  NameRollingShutters(rig, result);
  return absl::OkStatus();
}

// The same data with refined intrinsics, put away.
struct RefinedLenses {
  RigSolution solution;
  RigUncertainty uncertainty;  // by independent errors
};

// None where the data leave something undetermined.
std::optional<RefinedLenses> RefinedLensesOf(const RigObservations& rig,
                                             const RigSolveOptions& options, RigSolution solution) {
  absl::StatusOr<RigUncertainty> uncertainty = ComputeNoiseUncertainty(solution);
  if (!uncertainty.ok()) return std::nullopt;
  PutAway(rig, options, &solution);
  return RefinedLenses{std::move(solution), *std::move(uncertainty)};
}

}  // namespace

absl::StatusOr<EvaluatedSolution> SolveAndEvaluate(
    const RigObservations& rig, const std::vector<ClockCorrection>& clocks,
    const RigSolveOptions& base, const CalibrationOptions& options, const RigInitialization* given,
    const std::function<absl::Status(const RigSolution& solution)>& check) {
  EvaluatedSolution result;
  result.options = base;
  RigSolveOptions first = base;
  const std::vector<ImageMotion> motions = MotionsOf(rig);
  first.motions = &motions;
  first.refine_intrinsics = options.intrinsics == Estimate::kRefined;
  const bool choose =
      options.intrinsics == Estimate::kDefault || options.intrinsics == Estimate::kAuto;
  RIGCAL_ASSIGN_OR_RETURN(result.solution, SolveRig(rig, clocks, first, given));
  if (base.estimate_time_offsets) RIGCAL_RETURN_IF_ERROR(RepairOffsets(rig, first, &result));
  RIGCAL_RETURN_IF_ERROR(LeaveWrongMinimum(rig, clocks, first, &result));
  RIGCAL_RETURN_IF_ERROR(CheckHeld(result.solution.built.problem));
  if (check) RIGCAL_RETURN_IF_ERROR(check(result.solution));
  if (base.estimate_time_offsets) {
    RIGCAL_RETURN_IF_ERROR(TryLineDelays(rig, &first, &result.solution));
    TakeBack(rig, first, &result.solution);
    RIGCAL_RETURN_IF_ERROR(TryRates(rig, &first, &result.solution));
    TakeBack(rig, first, &result.solution);
    if (first.estimate_time_rates && first.estimate_line_delays.empty()) {
      // Clocks that drift had hidden them: they were not the same in both halves.
      RIGCAL_RETURN_IF_ERROR(TryLineDelays(rig, &first, &result.solution));
      TakeBack(rig, first, &result.solution);
    }
  }
  result.options.estimate_line_delays = first.estimate_line_delays;
  result.options.estimate_time_rates = first.estimate_time_rates;
  result.options.own_rates = first.own_rates;
  const RigInitialization initial = InitializationFrom(result.solution);
  const bool tries_path = TriesPath(rig, first, result.solution, options.trajectory);
  TimeBlocks blocks;
  blocks.origin_ns = result.solution.built.instant_time_ns.front();
  const bool by_camera = base.held == nullptr && LooksAtLensesAlone(result.solution.built.problem);
  std::optional<IntrinsicsChoice> chosen_by_camera;
  if (choose && by_camera) {
    if (base.progress) base.progress(CalibrationStage::kChoosingIntrinsics, 0);
    chosen_by_camera =
        ChooseIntrinsicsByCamera(rig, result.solution.built.problem, first, blocks.period);
  }
  PutAway(rig, first, &result.solution);

  IntrinsicsChoice intrinsics;
  if (choose && by_camera) {
    intrinsics = *std::move(chosen_by_camera);
  } else if (choose) {
    RIGCAL_ASSIGN_OR_RETURN(intrinsics,
                            ChooseIntrinsics(rig, initial, result.solution, blocks, first));
  }
  std::optional<RigSolution> with_refined_lenses;
  if (intrinsics.refine) {
    RigSolveOptions with_refined = first;
    with_refined.refine_intrinsics = true;
    if (by_camera) with_refined.keep_intrinsics = intrinsics.keep;
    RIGCAL_ASSIGN_OR_RETURN(with_refined_lenses,
                            SolveRig(rig, initial.clocks, with_refined, &initial));
    TakeBack(rig, first, &result.solution);
    if (const auto lenses = CompareLenses(result.solution, *with_refined_lenses, first);
        lenses && !lenses->RefinedIsNearer()) {
      KeepGiven(*lenses, &intrinsics);
    }
    PutAway(rig, first, &result.solution);
    PutAway(rig, with_refined, &*with_refined_lenses);
    if (by_camera && intrinsics.refine) {
      first.keep_intrinsics = result.options.keep_intrinsics = intrinsics.keep;
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(FoldResults folds,
                          EvaluateFolds(rig, initial, result.solution, blocks, first,
                                        intrinsics.refine_in_fold, tries_path));
  if (tries_path) result.path_gain = folds.path_gain;
  if (folds.by_instants.held_out.instant_count > 0) {
    result.held_out = std::move(folds.by_instants.held_out);
  } else {
    result.findings.push_back({FindingKind::kNotEvaluated, "", 0, "",
                               "too little data to hold any out: the errors are those of the data "
                               "that was solved. Record a minute or more"});
  }
  if (choose) {
    result.options.refine_intrinsics = intrinsics.refine;
    result.refined_by_chance = intrinsics.refined_by_chance;
    result.findings.push_back(std::move(intrinsics.finding));
  } else {
    result.options.refine_intrinsics = first.refine_intrinsics;
  }
  if (result.options.refine_intrinsics != first.refine_intrinsics) {
    first.refine_intrinsics = result.options.refine_intrinsics;
    result.solution = *std::move(with_refined_lenses);
  }
  // Also where given intrinsics are asked for, the data say how far they are off.
  const auto refine_all = [&]() -> absl::StatusOr<std::optional<RefinedLenses>> {
    RigSolveOptions with_refined = result.options;
    with_refined.refine_intrinsics = true;
    with_refined.rough = true;
    with_refined.motions = &motions;
    with_refined.progress = ProgressAs(CalibrationStage::kEvaluating, base);
    absl::StatusOr<RigSolution> other = SolveRig(rig, initial.clocks, with_refined, &initial);
    if (absl::IsCancelled(other.status())) return other.status();
    if (!other.ok()) return std::nullopt;
    return RefinedLensesOf(rig, with_refined, *std::move(other));
  };
  std::optional<RefinedLenses> refined;
  if (!result.options.refine_intrinsics && !by_camera) {
    RIGCAL_ASSIGN_OR_RETURN(refined, refine_all());
  }
  TakeBack(rig, result.options, &result.solution);
  if (result.held_out) {
    RigSolveOptions lens_options = result.options;
    lens_options.motions = &motions;
    lens_options.progress = ProgressAs(CalibrationStage::kChoosingIntrinsics, base);
    RIGCAL_ASSIGN_OR_RETURN(result.lenses,
                            FindBetterLenses(rig, result.solution, lens_options, by_camera));
    for (const BetterLens& lens : result.lenses) {
      result.findings.push_back(FindingOf(rig, lens, false));
    }
  }
  absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(result.solution, result.options);
  if (uncertainty.ok()) {
    result.uncertainty = *std::move(uncertainty);
    NameRollingShutters(rig, &result);
    const bool any = std::ranges::find(result.findings, FindingKind::kRollingShutter,
                                       &Finding::kind) != result.findings.end();
    if (!any && !result.options.estimate_line_delays.empty()) {
      RIGCAL_RETURN_IF_ERROR(
          DropLineDelays(rig, &result.options, &result.solution, &*result.uncertainty));
    }
  }
  if (tries_path && KeepsPath(folds.path_gain, options.trajectory)) {
    RIGCAL_RETURN_IF_ERROR(FollowTarget(rig, &folds, &result));
  }
  // In a large rig only where one step of the solve shows that they are.
  if (by_camera && !result.options.refine_intrinsics && result.uncertainty &&
      LensesMayDiffer(rig, result.solution, result.options, result.uncertainty->design_effect)) {
    RIGCAL_ASSIGN_OR_RETURN(refined, refine_all());
  }
  if (refined && result.uncertainty) {
    result.lenses_kept =
        MeasureKeptLenses(result.solution.built.problem.cameras, refined->solution.built.problem,
                          refined->uncertainty, result.uncertainty->design_effect);
  }
  result.predicted =
      PredictError(result.solution, result.uncertainty, result.lenses_kept, folds.by_instants.poses,
                   IsMetric(rig, result.options) ? options.accept_m : 0);
  return result;
}

}  // namespace rigcal::server
