// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/running_solve.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "common/camera/intrinsics_vector.h"
#include "common/status/status_macros.h"
#include "server/associate/instants.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/evaluate/error_figures.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/rig/rig_solver.h"
#include "server/solve/running/instant_thinning.h"

namespace rigcal::server {
namespace {

constexpr int kMinRefineInstants = 100;
constexpr int kMinHeldOutInstants = 30;
constexpr int kMinEvaluatedInstants = 20, kMaxHeldOutInstants = 100;
constexpr double kMayExceed = 1.25;       // held-out errors those that were solved
constexpr double kMaxOutlierShare = 0.3;  // of a start that still fits

std::vector<double> AllOf(const std::vector<std::vector<double>>& errors) {
  std::vector<double> all;
  for (const std::vector<double>& camera : errors)
    all.insert(all.end(), camera.begin(), camera.end());
  return all;
}

// Of leave-one-out errors, or where there are too few of reprojection errors.
double RmsPx(const EvaluatedErrors& errors) {
  std::vector<double> values = AllOf(errors.leave_one_out_px);
  if (values.size() < kMinHeldOutInstants) values = AllOf(errors.reprojection_px);
  return Figures(std::move(values)).rms_px;
}

class RunningSolver {
 public:
  RunningSolver(RigObservations rig, std::vector<ClockCorrection> clocks, const RunningInput& input)
      : input_(input), rig_(std::move(rig)), clocks_(std::move(clocks)) {
    options_.estimate_marker_positions = rig_.target.marker_count() > 1;
    options_.cancelled = input_.cancelled;
  }

  absl::StatusOr<RunningSolution> Run() {
    CountInstants();
    RIGCAL_RETURN_IF_ERROR(SolveOnce());
    RIGCAL_RETURN_IF_ERROR(ChooseIntrinsics());
    if (input_.check_held_out) RIGCAL_RETURN_IF_ERROR(CheckHeldOut());
    if (!uncertainty_) {
      RIGCAL_ASSIGN_OR_RETURN(uncertainty_, ComputeUncertainty(solution_, Thinned()));
    }
    return RunningSolution{.rig = std::move(rig_),
                           .options = Thinned(),
                           .solution = std::move(solution_),
                           .uncertainty = *std::move(uncertainty_),
                           .lens_test = std::move(lens_test_),
                           .lenses_kept = std::move(lenses_kept_),
                           .held_out = held_out_,
                           .instant_count = thinning_.instant_count()};
  }

 private:
  bool StartFits() const {
    const auto& known = input_.start.cameras;
    if (known.size() != rig_.index.cameras.size()) return false;
    for (size_t c = 0; c < known.size(); ++c) {
      if (known[c].name != rig_.index.cameras[c].camera) return false;
    }
    return true;
  }

  bool MayRefine() const { return thinning_.instant_count() >= kMinRefineInstants; }

  absl::Status SolveOnce() {
    if (StartFits()) {
      options_.refine_intrinsics = MayRefine();
      const RigInitialization initial = FromStart();
      absl::StatusOr<RigSolution> solution = SolveRig(rig_, clocks_, Thinned(), &initial);
      if (solution.ok() && OutlierShare(*solution) < kMaxOutlierShare) {
        solution_ = *std::move(solution);
        return absl::OkStatus();
      }
      if (absl::IsCancelled(solution.status())) return solution.status();
      options_.refine_intrinsics = false;
    }
    return SolveFromNothing();
  }

  absl::Status SolveFromNothing() {
    for (ClockCorrection& clock : clocks_) clock.time_offset_s = clock.time_rate = 0;
    const std::vector<ClockCorrection> given = clocks_;
    RIGCAL_RETURN_IF_ERROR(
        SearchTimeOffsets(rig_, options_.reference_camera, {{}, input_.cancelled, true}, &clocks_));
    CountInstants();
    const RigSolveOptions thinned = Thinned();
    absl::StatusOr<RigSolution> solution = SolveRig(rig_, clocks_, thinned);
    if (!solution.ok() && !absl::IsCancelled(solution.status())) {
      clocks_ = given;
      CountInstants();
      solution = SolveRig(rig_, clocks_, Thinned());
    }
    RIGCAL_RETURN_IF_ERROR(solution.status());
    solution_ = *std::move(solution);
    return RestartIfWrong(rig_, clocks_, Thinned(), &solution_).status();
  }

  void CountInstants() {
    thinning_ = InstantThinning(
        FindInstants(rig_.tracks, RigTimes(rig_.tracks, rig_.index, clocks_), 0), input_.max_views);
  }

  RigSolveOptions Thinned() const {
    RigSolveOptions options = options_;
    options.keep_instant = [thinning = thinning_](int64_t t) { return thinning.IsChosen(t); };
    return options;
  }

  RigInitialization FromStart() const {
    RigInitialization initial;
    for (size_t c = 0; c < rig_.index.cameras.size(); ++c) {
      const EstimateStart::Camera& known = input_.start.cameras[c];
      BundleCamera camera;
      camera.cam_from_rig = known.cam_from_rig;
      camera.intrinsics = ToVector(options_.refine_intrinsics ? known.intrinsics
                                                              : *rig_.index.cameras[c].intrinsics);
      initial.cameras.push_back(std::move(camera));
    }
    initial.marker_positions_m = input_.start.marker_positions_m;
    initial.clocks = clocks_;
    return initial;
  }

  static double OutlierShare(const RigSolution& solution) {
    double out = 0;
    for (const BundleMarker& marker : solution.built.problem.markers) out += marker.used ? 0 : 1;
    return out / static_cast<double>(std::max<size_t>(1, solution.built.problem.markers.size()));
  }

  RigInitialization Begin(const RigInitialization& initial, bool refine) const {
    RigInitialization begin = initial;
    if (refine) return begin;
    for (size_t c = 0; c < begin.cameras.size(); ++c) {
      begin.cameras[c].intrinsics = ToVector(*rig_.index.cameras[c].intrinsics);
    }
    return begin;
  }

  // Refined ones where those given are seen to be wrong.
  absl::Status ChooseIntrinsics() {
    if (!MayRefine()) return absl::OkStatus();
    const RigInitialization initial = InitializationFrom(solution_);
    if (!options_.refine_intrinsics) {
      options_.refine_intrinsics = true;
      RIGCAL_ASSIGN_OR_RETURN(solution_, SolveRig(rig_, initial.clocks, Thinned(), &initial));
    }
    RIGCAL_ASSIGN_OR_RETURN(uncertainty_, ComputeUncertainty(solution_, Thinned()));
    lens_test_ = TestGivenIntrinsics(solution_.built.problem, *uncertainty_);
    if (!lens_test_.agrees) return absl::OkStatus();
    const RigInitialization begin = Begin(InitializationFrom(solution_), false);
    RigSolveOptions given = Thinned();
    given.refine_intrinsics = false;
    absl::StatusOr<RigSolution> solution = SolveRig(rig_, begin.clocks, given, &begin);
    if (absl::IsCancelled(solution.status())) return solution.status();
    if (!solution.ok() || OutlierShare(*solution) >= kMaxOutlierShare) return absl::OkStatus();
    lenses_kept_ = MeasureKeptLenses(solution->built.problem.cameras, solution_.built.problem,
                                     *uncertainty_, uncertainty_->design_effect);
    solution_ = *std::move(solution);
    options_.refine_intrinsics = false;
    uncertainty_.reset();
    return absl::OkStatus();
  }

  // One of four blocks of time is held out, another one each time: are the errors on it those that
  // the solution has elsewhere?
  absl::Status CheckHeldOut() {
    TimeBlocks blocks;
    blocks.origin_ns = thinning_.origin_ns();
    const int fold = input_.start.round % blocks.period;
    const auto is_held_out = [&](int64_t t) { return blocks.IsHeldOut(t, fold); };
    const auto held_out = std::ranges::count_if(solution_.built.instant_time_ns, is_held_out);
    if (held_out < kMinHeldOutInstants) return absl::OkStatus();
    // Some of them, and as many of those that are solved.
    const int64_t one_of = (held_out + kMaxHeldOutInstants - 1) / kMaxHeldOutInstants;
    const int other = (fold + 2) % blocks.period;
    RigSolveOptions options = options_;
    options.keep_instant = [&](int64_t t) {
      return blocks.IsKept(t, fold) && thinning_.IsChosen(t);
    };
    const RigInitialization begin = InitializationFrom(solution_);
    const absl::StatusOr<RigSolution> solution = SolveRig(rig_, begin.clocks, options, &begin);
    if (absl::IsCancelled(solution.status())) return solution.status();
    if (!solution.ok()) return absl::OkStatus();
    const auto evaluate = [&](int remainder) {
      return EvaluateSolution(rig_, *solution, options, [&, remainder](int64_t t) {
        return blocks.IsHeldOut(t, remainder) && thinning_.IsChosen(t, one_of);
      });
    };
    const EvaluatedErrors unseen = evaluate(fold), seen = evaluate(other);
    if (unseen.instant_count < kMinEvaluatedInstants ||
        seen.instant_count < kMinEvaluatedInstants) {
      return absl::OkStatus();
    }
    held_out_ = HeldOutCheck{RmsPx(unseen), RmsPx(seen), false};
    held_out_->agrees = held_out_->rms_px < kMayExceed * held_out_->expected_rms_px;
    return absl::OkStatus();
  }

  const RunningInput& input_;
  RigObservations rig_;
  std::vector<ClockCorrection> clocks_;
  RigSolveOptions options_;
  InstantThinning thinning_;
  RigSolution solution_;
  std::optional<RigUncertainty> uncertainty_;  // of solution_; none: not computed yet
  GivenIntrinsicsTest lens_test_;
  KeptLenses lenses_kept_;
  std::optional<HeldOutCheck> held_out_;
};

}  // namespace

absl::StatusOr<RunningSolution> SolveRunning(RigObservations rig,
                                             std::vector<ClockCorrection> clocks,
                                             const RunningInput& input) {
  return RunningSolver(std::move(rig), std::move(clocks), input).Run();
}

}  // namespace rigcal::server
