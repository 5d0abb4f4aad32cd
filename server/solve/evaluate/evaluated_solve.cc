// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/evaluated_solve.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/clocks/clock_rates.h"
#include "server/solve/clocks/time_check.h"
#include "server/solve/evaluate/held_out_choice.h"
#include "server/solve/evaluate/path_choice.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/initialize/shared_views.h"
#include "server/solve/rig/line_delays.h"
#include "server/solve/rig/trajectory_fit.h"

namespace rigcal::server {
namespace {

constexpr int kMinHeldOutInstants = 20;
// That a choice is evaluated on.
constexpr size_t kChoiceObservations = 10'000;
// A refinement must make the held-out error smaller by this share to be kept.
constexpr double kMustGain = 0.02;
// And by so many standard errors over long blocks of time.
constexpr double kChoiceSigmas = 2;
constexpr int kMaxRateTries = 4;
constexpr int kMaxTimeRepairs = 3;
constexpr double kMayLoseInliers = 0.05;  // of all markers
constexpr int kMinLongBlocks = 4;
constexpr int kMinAgreeingViews = 8;  // of a camera; fewer hold no pose
// Of a rolling shutter that is named: sigmas of its line delay, and the time over the image.
constexpr double kShutterSigmas = 8, kMinReadoutS = 2e-3;

std::function<void(CalibrationStage, double)> AllAs(CalibrationStage stage,
                                                    const RigSolveOptions& options) {
  if (!options.progress) return {};
  return [progress = options.progress, stage](CalibrationStage, double fraction) {
    progress(stage, fraction);
  };
}

using Select = std::function<bool(int64_t rig_time_ns)>;

absl::StatusOr<EvaluatedErrors> MeasureOn(const RigObservations& rig, const RigSolution& solution,
                                          RigSolveOptions options, size_t max_observations,
                                          const Select& evaluate_on) {
  options.max_observations = max_observations;
  EvaluatedErrors errors = EvaluateSolution(rig, solution, options, evaluate_on);
  if (errors.instant_count < kMinHeldOutInstants) {
    return absl::FailedPreconditionError("too few instants are held out");
  }
  return errors;
}

// Share of the placed instants that a fold leaves out before it is thinned: the scatter of thinned
// folds is that of a recording as short, which errs on the safe side.
double LeftOutOf(const RigSolution& solution, const TimeBlocks& blocks, int fold) {
  double all = 0, kept = 0;
  for (size_t i = 0; i < solution.built.problem.instants.size(); ++i) {
    if (!solution.built.problem.instants[i].used) continue;
    ++all;
    kept += blocks.IsKept(solution.built.instant_time_ns[i], fold) ? 1 : 0;
  }
  return all > 0 ? 1 - kept / all : 0;
}

// Held-out errors of the two ways to treat intrinsics, summed over the folds that had both.
struct IntrinsicsScores {
  double given_px = 0;
  double refined_px = 0;
  int folds = 0;

  bool RefinedPays() const { return folds > 0 && refined_px < (1 - kMustGain) * given_px; }
  void Add(const IntrinsicsScores& other) {
    given_px += other.given_px;
    refined_px += other.refined_px;
    folds += other.folds;
  }
};

// For each fold, within what it leaves: two solves without the blocks of another fold, evaluated on
// those. Of two folds that leave out each other's blocks, the solves are the same.
absl::StatusOr<std::vector<IntrinsicsScores>> ScoreIntrinsics(const RigObservations& rig,
                                                              const RigInitialization& initial,
                                                              const TimeBlocks& blocks,
                                                              const RigSolveOptions& base) {
  std::vector<IntrinsicsScores> scores(static_cast<size_t>(blocks.period));
  const int apart = blocks.period / 2;
  for (int a = 0; a < apart; ++a) {
    const int b = a + apart;
    // By fold, by whether intrinsics are refined.
    double score_px[2][2] = {{INFINITY, INFINITY}, {INFINITY, INFINITY}};
    for (const bool refine : {false, true}) {
      RigSolveOptions options = OptionsOfFold(rig, base, [&blocks, a, b](int64_t t) {
        return blocks.IsKept(t, a) && blocks.IsKept(t, b);
      });
      options.refine_intrinsics = refine;
      options.progress = AllAs(CalibrationStage::kChoosingIntrinsics, base);
      const absl::StatusOr<RigSolution> solution = SolveFold(rig, initial, options);
      if (absl::IsCancelled(solution.status())) return solution.status();
      if (!solution.ok()) continue;
      for (const bool second : {false, true}) {
        const int outer = second ? b : a, inner = second ? a : b;
        const absl::StatusOr<EvaluatedErrors> errors = MeasureOn(
            rig, *solution, options, kChoiceObservations, [&blocks, outer, inner](int64_t t) {
              return blocks.IsHeldOut(t, inner) && blocks.IsKept(t, outer);
            });
        if (errors.ok()) score_px[second][refine] = ChoiceScorePx(*errors);
      }
    }
    for (const bool second : {false, true}) {
      const auto& [given_px, refined_px] = score_px[second];
      if (!std::isfinite(given_px) || !std::isfinite(refined_px)) continue;
      scores[static_cast<size_t>(second ? b : a)] = {given_px, refined_px, 1};
    }
  }
  return scores;
}

// Refined intrinsics that pay between neighbouring times, over long blocks: given ones before,
// refined ones after. None where there are too few blocks, or a variant could not be solved.
absl::StatusOr<std::optional<HeldOutGain>> CompareOverLongBlocks(const RigObservations& rig,
                                                                 const RigInitialization& initial,
                                                                 const RigSolution& solution,
                                                                 const RigSolveOptions& base) {
  const auto& times_ns = solution.built.instant_time_ns;
  const auto [first, last] = std::ranges::minmax_element(times_ns);
  const TimeBlocks blocks = LongBlocks(*first, *last);
  const int count = CountBlocks(blocks, *last);
  if (count < kMinLongBlocks) return std::nullopt;
  std::vector<SolveVariant> variants(2, {&rig, &initial, base});
  for (const bool refine : {false, true}) {
    RigSolveOptions& options = variants[refine ? 1 : 0].options;
    options.refine_intrinsics = refine;
    options.progress = AllAs(CalibrationStage::kChoosingIntrinsics, base);
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto errors, EvaluateVariants(variants, blocks, count));
  if (errors[0].empty() || errors[1].empty()) return std::nullopt;
  const HeldOutGain gain = CompareVariants(errors[0], errors[1]);
  if (gain.blocks < kMinLongBlocks) return std::nullopt;
  return gain;
}

Finding KeptFinding(const IntrinsicsScores& scores, const HeldOutGain& gain) {
  return {FindingKind::kIntrinsicsKept, "", gain.before_px, "px",
          absl::StrFormat(
              "held-out error over %d long blocks of time %.3f px with the given intrinsics, %.3f "
              "px with refined ones, which differ by no more than chance (one sigma %.3f px); "
              "between neighbouring times %.3f and %.3f px. The given ones are used",
              gain.blocks, gain.before_px, gain.after_px, gain.sigma_px,
              scores.given_px / scores.folds, scores.refined_px / scores.folds)};
}

Finding IntrinsicsFinding(const IntrinsicsScores& scores) {
  if (scores.folds == 0) {
    return {FindingKind::kIntrinsicsKept, "", 0, "px",
            "too little data to check refined intrinsics; the given ones are kept. Record longer, "
            "or ask for refinement"};
  }
  const bool pays = scores.RefinedPays();
  const double given_px = scores.given_px / scores.folds;
  const double refined_px = scores.refined_px / scores.folds;
  return {pays ? FindingKind::kIntrinsicsRefined : FindingKind::kIntrinsicsKept, "",
          pays ? refined_px : given_px, "px",
          absl::StrFormat("held-out error %.3f px with the given intrinsics, %.3f px with refined "
                          "ones; the %s are used",
                          given_px, refined_px, pays ? "refined ones" : "given ones")};
}

// Of the markers, those that take part.
double InlierShare(const RigSolution& solution) {
  double used = 0;
  for (const BundleMarker& marker : solution.built.problem.markers) used += marker.used ? 1 : 0;
  return used / static_cast<double>(std::max<size_t>(1, solution.built.problem.markers.size()));
}

// From the first to the last observation of a clock.
double ClockSpanS(const BundleProblem& problem, int clock) {
  double first_s = INFINITY, last_s = -INFINITY;
  for (const BundleObservation& observation : problem.observations) {
    if (observation.clock != clock) continue;
    first_s = std::min(first_s, observation.clock_time_s);
    last_s = std::max(last_s, observation.clock_time_s);
  }
  return last_s > first_s ? last_s - first_s : 0;
}

// The clocks whose rate is significantly not zero. By the covariance of the noise alone: what
// neighbouring instants have in common hardly drifts, and FindOwnRates asks for five sigmas.
std::vector<bool> OwnRates(const RigSolution& solution, RigUncertainty uncertainty) {
  uncertainty.covariance = uncertainty.noise_covariance;
  std::vector<RateEstimate> rates;
  for (size_t k = 0; k < solution.clocks.size(); ++k) {
    const BundleProblem& problem = solution.built.problem;
    rates.push_back({solution.clocks[k].session_id,
                     solution.clocks[k].time_rate + problem.clocks[k].time_rate,
                     ClockSpanS(problem, static_cast<int>(k)), !problem.clocks[k].rate_fixed});
  }
  const auto sigma_between = [&](size_t k, size_t l) {
    std::vector<double> weights(solution.clocks.size(), 0);
    weights[k] = 1;
    weights[l] = -1;
    return uncertainty.ClockSigma(ReducedParameterKind::kTimeRate, weights);
  };
  return FindOwnRates(rates, sigma_between);
}

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
    const double share = InlierShare(result->solution);
    PutAway(rig, options, &result->solution);
    absl::StatusOr<RigSolution> again = SolveRig(rig, clocks, options);
    if (absl::IsCancelled(again.status())) return again.status();
    // Another time groups other views; only a fit that breaks is a reason to stay.
    if (!again.ok() || InlierShare(*again) < share - kMayLoseInliers) {
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

// A rough solve of all data in which some clock's rate stands out; none if there is none.
absl::StatusOr<std::optional<RigInitialization>> WithOwnRates(const RigObservations& rig,
                                                              RigSolveOptions options,
                                                              const RigInitialization& initial) {
  options.rough = true;
  const absl::StatusOr<RigSolution> tried = SolveRig(rig, initial.clocks, options, &initial);
  if (absl::IsCancelled(tried.status())) return tried.status();
  if (!tried.ok()) return std::nullopt;
  const absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*tried, options);
  if (!uncertainty.ok()) return std::nullopt;
  if (std::ranges::count(OwnRates(*tried, *uncertainty), true) == 0) return std::nullopt;
  return InitializationFrom(*tried);
}

// Gives rates to the clocks that are seen to run differently: all are tried, then those that stood
// out alone, until all of them still do. What could not be solved has no rates.
// `solution` may be put away on return.
absl::Status TryRates(const RigObservations& rig, RigSolveOptions* options, RigSolution* solution) {
  RigSolveOptions with_rates = *options;
  with_rates.estimate_time_rates = true;
  const RigInitialization initial = InitializationFrom(*solution);
  PutAway(rig, *options, solution);
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<RigInitialization> begin,
                          WithOwnRates(rig, with_rates, initial));
  if (!begin) return absl::OkStatus();
  for (int i = 0; i < kMaxRateTries; ++i) {
    absl::StatusOr<RigSolution> tried =
        SolveRig(rig, (i == 0 ? *begin : initial).clocks, with_rates, i == 0 ? &*begin : &initial);
    if (absl::IsCancelled(tried.status())) return tried.status();
    if (!tried.ok()) return absl::OkStatus();
    const absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*tried, with_rates);
    if (!uncertainty.ok()) return absl::OkStatus();
    std::vector<bool> own = OwnRates(*tried, *uncertainty);
    if (std::ranges::count(own, true) == 0) return absl::OkStatus();
    std::vector<bool> estimated;
    for (const BundleClock& clock : tried->built.problem.clocks) {
      estimated.push_back(!clock.rate_fixed);
    }
    if (own == estimated) {
      with_rates.own_rates = std::move(own);
      *options = std::move(with_rates);
      *solution = *std::move(tried);
      return absl::OkStatus();
    }
    // Those that once were found to run alike stay so.
    for (size_t k = 0; k < with_rates.own_rates.size(); ++k) {
      own[k] = own[k] && with_rates.own_rates[k];
    }
    with_rates.own_rates = std::move(own);
  }
  return absl::OkStatus();
}

// Estimates line delays where a rolling shutter stands out, together with everything else. What
// could not be solved so stays as it is. `solution` may be put away on return.
absl::Status TryLineDelays(const RigObservations& rig, RigSolveOptions* options,
                           RigSolution* solution) {
  std::vector<int> heights_px;
  for (const CameraDescription& camera : rig.index.cameras) {
    heights_px.push_back(camera.image_size_px.height);
  }
  std::vector<LineDelay> delays;
  const absl::StatusOr<std::vector<bool>> roll =
      FindRollingShutters(solution->built.problem, heights_px, options->cancelled, &delays);
  if (absl::IsCancelled(roll.status())) return roll.status();
  if (!roll.ok() || roll->empty()) return absl::OkStatus();
  RigSolveOptions with_delays = *options;
  with_delays.estimate_line_delays = *roll;
  RigInitialization initial = InitializationFrom(*solution);
  for (size_t c = 0; c < roll->size(); ++c) {
    if ((*roll)[c]) initial.line_delay_s[c] += delays[c].line_delay_s;
  }
  const double share = InlierShare(*solution);
  PutAway(rig, *options, solution);
  absl::StatusOr<RigSolution> tried = SolveRig(rig, initial.clocks, with_delays, &initial);
  if (tried.ok() && !tried->converged) {
    initial = InitializationFrom(*tried);
    absl::StatusOr<RigSolution> further = SolveRig(rig, initial.clocks, with_delays, &initial);
    if (further.ok()) tried = std::move(further);
  }
  if (absl::IsCancelled(tried.status())) return tried.status();
  if (!tried.ok() || InlierShare(*tried) < share - kMayLoseInliers) return absl::OkStatus();
  *options = std::move(with_delays);
  *solution = *std::move(tried);
  return absl::OkStatus();
}

// The cameras whose line delay stands out in the result.
void AddShutterFindings(const RigObservations& rig, EvaluatedSolution* result) {
  const RigInitialization solved = InitializationFrom(result->solution);
  for (size_t c = 0; c < result->options.estimate_line_delays.size(); ++c) {
    const Eigen::Index row =
        result->uncertainty
            ? result->uncertainty->Row({ReducedParameterKind::kLineDelay, static_cast<int>(c), 0})
            : -1;
    if (row < 0) continue;
    const double delay_s = solved.line_delay_s[c];
    const double sigma_s = std::sqrt(result->uncertainty->covariance(row, row));
    const double readout_s = std::abs(delay_s) * rig.index.cameras[c].image_size_px.height;
    if (std::abs(delay_s) < kShutterSigmas * sigma_s || readout_s < kMinReadoutS) continue;
    result->findings.push_back(
        {FindingKind::kRollingShutter, rig.index.cameras[c].camera, 1e6 * delay_s, "us",
         absl::StrFormat("its image rows are taken one after the other, %.2f us apart (+-%.2f us), "
                         "%.1f ms over the image; the calibration takes this into account",
                         1e6 * delay_s, 1e6 * sigma_s, 1e3 * readout_s)});
  }
}

// What looked like a rolling shutter with the given intrinsics may be none with refined ones: where
// none is left that stands out, the result has none.
absl::Status DropLineDelays(const RigObservations& rig, RigSolveOptions options,
                            EvaluatedSolution* result) {
  if (result->options.estimate_line_delays.empty() || !result->uncertainty ||
      std::ranges::find(result->findings, FindingKind::kRollingShutter, &Finding::kind) !=
          result->findings.end()) {
    return absl::OkStatus();
  }
  RigInitialization initial = InitializationFrom(result->solution);
  initial.line_delay_s.clear();
  options.estimate_line_delays.clear();
  absl::StatusOr<RigSolution> without = SolveRig(rig, initial.clocks, options, &initial);
  if (absl::IsCancelled(without.status())) return without.status();
  if (!without.ok()) return absl::OkStatus();
  absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*without, options);
  if (!uncertainty.ok()) return absl::OkStatus();
  result->solution = *std::move(without);
  result->uncertainty = *std::move(uncertainty);
  result->options.estimate_line_delays.clear();
  return absl::OkStatus();
}

// Follows the target through time in the end; what cannot be followed stays as it is.
absl::Status FollowTarget(const RigObservations& rig, const TrajectoryFit* like,
                          EvaluatedSolution* result) {
  absl::StatusOr<RigSolution> followed =
      SolveOnTrajectory(rig, result->options, result->solution, like);
  if (absl::IsCancelled(followed.status())) return followed.status();
  if (!followed.ok()) return absl::OkStatus();
  absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(*followed, result->options);
  if (!uncertainty.ok()) return absl::OkStatus();
  result->solution = *std::move(followed);
  result->uncertainty = *std::move(uncertainty);
  std::erase_if(result->findings, [](const Finding& finding) {
    return finding.kind == FindingKind::kRollingShutter;
  });
  AddShutterFindings(rig, result);
  return absl::OkStatus();
}

void Append(const EvaluatedErrors& from, EvaluatedErrors* to) {
  const auto append = [](const std::vector<std::vector<double>>& source, auto* target) {
    target->resize(source.size());
    for (size_t i = 0; i < source.size(); ++i) {
      (*target)[i].insert((*target)[i].end(), source[i].begin(), source[i].end());
    }
  };
  append(from.reprojection_px, &to->reprojection_px);
  append(from.leave_one_out_px, &to->leave_one_out_px);
  append(from.lengths, &to->lengths);
  to->instant_count += from.instant_count;
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
  }
  result.options.estimate_line_delays = first.estimate_line_delays;
  result.options.estimate_time_rates = first.estimate_time_rates;
  result.options.own_rates = first.own_rates;
  const RigInitialization initial = InitializationFrom(result.solution);
  const bool tries_path = TriesPath(rig, first, result.solution, options.trajectory);
  PutAway(rig, first, &result.solution);
  TimeBlocks blocks;
  blocks.origin_ns = result.solution.built.instant_time_ns.front();

  IntrinsicsScores scores;
  std::vector<IntrinsicsScores> scores_of_fold;
  if (choose) {
    RIGCAL_ASSIGN_OR_RETURN(scores_of_fold, ScoreIntrinsics(rig, initial, blocks, first));
  }
  for (const IntrinsicsScores& own : scores_of_fold) scores.Add(own);
  // What does not hold over long blocks is refined in no fold.
  std::optional<HeldOutGain> by_chance;
  if (scores.RefinedPays()) {
    RIGCAL_ASSIGN_OR_RETURN(by_chance, CompareOverLongBlocks(rig, initial, result.solution, first));
    if (by_chance && by_chance->IsClear(kMustGain, kChoiceSigmas)) by_chance.reset();
  }
  const int block_count = static_cast<int>(blocks.Block(
                              *std::ranges::max_element(result.solution.built.instant_time_ns))) +
                          1;
  std::vector<EvaluatedErrors> by_instants, by_path;  // by held-out block
  EvaluatedErrors held_out, held_out_by_path;
  std::vector<FoldPoses> folds, path_folds;
  std::shared_ptr<const TrajectoryFit> like;
  for (int fold = 0; fold < blocks.period; ++fold) {
    RigSolveOptions fold_options =
        OptionsOfFold(rig, first, [&blocks, fold](int64_t t) { return blocks.IsKept(t, fold); });
    fold_options.progress = AllAs(CalibrationStage::kEvaluating, base);
    if (choose) {
      fold_options.refine_intrinsics =
          !by_chance && scores_of_fold[static_cast<size_t>(fold)].RefinedPays();
    }
    if (tries_path) fold_options.max_observations = 0;
    absl::StatusOr<RigSolution> solution = SolveFold(rig, initial, fold_options);
    if (absl::IsCancelled(solution.status())) return solution.status();
    if (!solution.ok()) continue;
    const Select is_held_out = [&blocks, fold](int64_t t) { return blocks.IsHeldOut(t, fold); };
    const absl::StatusOr<EvaluatedErrors> errors =
        MeasureOn(rig, *solution, fold_options, 0, is_held_out);
    if (!errors.ok()) continue;
    Append(*errors, &held_out);
    folds.push_back(FoldPosesOf(*solution, 1));
    folds.back().left_out = LeftOutOf(result.solution, blocks, fold);
    if (!tries_path) continue;
    absl::StatusOr<PathFold> path =
        FollowInFold(rig, fold_options, blocks, fold, block_count, like.get(), &*solution);
    if (absl::IsCancelled(path.status())) return path.status();
    if (!path.ok()) continue;
    const absl::StatusOr<EvaluatedErrors> path_errors =
        MeasureOn(rig, path->solution, fold_options, 0, is_held_out);
    if (!path_errors.ok()) continue;
    like = path->solution.trajectory;
    Append(*path_errors, &held_out_by_path);
    path_folds.push_back(FoldPosesOf(path->solution, 1));
    path_folds.back().left_out = folds.back().left_out;
    by_instants.insert(by_instants.end(), path->before.begin(), path->before.end());
    by_path.insert(by_path.end(), path->after.begin(), path->after.end());
  }
  if (tries_path) result.path_gain = CompareVariants(by_instants, by_path);
  const bool follows = tries_path && KeepsPath(*result.path_gain, options.trajectory);
  if (follows && held_out_by_path.instant_count > 0) {
    held_out = std::move(held_out_by_path);
    folds = std::move(path_folds);
  }
  if (held_out.instant_count > 0) {
    result.held_out = std::move(held_out);
  } else {
    result.findings.push_back({FindingKind::kNotEvaluated, "", 0, "",
                               "too little data to hold any out: the errors are those of the data "
                               "that was solved. Record a minute or more"});
  }
  if (choose) {
    result.options.refine_intrinsics = !by_chance && scores.RefinedPays();
    result.refined_by_chance = by_chance.has_value();
    result.findings.push_back(by_chance ? KeptFinding(scores, *by_chance)
                                        : IntrinsicsFinding(scores));
  } else {
    result.options.refine_intrinsics = first.refine_intrinsics;
  }
  if (result.options.refine_intrinsics != first.refine_intrinsics) {
    first.refine_intrinsics = result.options.refine_intrinsics;
    RIGCAL_ASSIGN_OR_RETURN(result.solution, SolveRig(rig, initial.clocks, first, &initial));
  }
  // Kept intrinsics are as uncertain as the data leaves them, also where they are asked for.
  std::optional<FoldPoses> refined;
  if (!result.options.refine_intrinsics) {
    RigSolveOptions with_refined = result.options;
    with_refined.refine_intrinsics = true;
    with_refined.rough = true;
    with_refined.motions = &motions;
    with_refined.progress = AllAs(CalibrationStage::kEvaluating, base);
    const absl::StatusOr<RigSolution> other = SolveRig(rig, initial.clocks, with_refined, &initial);
    if (absl::IsCancelled(other.status())) return other.status();
    if (other.ok()) refined = FoldPosesOf(*other, 1);
  }
  TakeBack(rig, result.options, &result.solution);
  if (result.held_out) {
    RigSolveOptions lens_options = result.options;
    lens_options.motions = &motions;
    lens_options.progress = AllAs(CalibrationStage::kChoosingIntrinsics, base);
    RIGCAL_ASSIGN_OR_RETURN(result.lenses, FindBetterLenses(rig, result.solution, lens_options));
    for (const BetterLens& lens : result.lenses) {
      result.findings.push_back(FindingOf(rig, lens, false));
    }
  }
  absl::StatusOr<RigUncertainty> uncertainty = ComputeUncertainty(result.solution, result.options);
  if (uncertainty.ok()) result.uncertainty = *std::move(uncertainty);
  AddShutterFindings(rig, &result);
  RIGCAL_RETURN_IF_ERROR(DropLineDelays(rig, first, &result));
  if (follows) RIGCAL_RETURN_IF_ERROR(FollowTarget(rig, like.get(), &result));
  result.predicted =
      PredictError(result.solution, result.uncertainty, folds, refined ? &*refined : nullptr,
                   IsMetric(rig, result.options) ? options.accept_m : 0);
  return result;
}

}  // namespace rigcal::server
