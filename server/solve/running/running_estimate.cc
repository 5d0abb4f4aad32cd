// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/running_estimate.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/camera/intrinsics_vector.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/refusal.h"
#include "common/status/status_macros.h"
#include "server/associate/align_clocks.h"
#include "server/associate/clean_track.h"
#include "server/associate/instants.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/evaluate/error_figures.h"
#include "server/solve/evaluate/evaluated_solve.h"
#include "server/solve/evaluate/given_intrinsics.h"
#include "server/solve/evaluate/held_out.h"
#include "server/solve/evaluate/restart.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_solver.h"

namespace rigcal::server {
namespace {

constexpr int kNeededInstants = 40;  // of a pair, to be joined
constexpr int kMinRefineInstants = 100;
constexpr int kMinHeldOutInstants = 30;
constexpr int kMinEvaluatedInstants = 20, kMaxHeldOutInstants = 100;
constexpr double kMayExceed = 1.25;       // held-out errors those that were solved
constexpr double kMaxOutlierShare = 0.3;  // of a start that still fits

// Cameras in groups joined by pairs with enough common instants.
struct Joined {
  std::vector<int> group_of_camera;
  int largest = 0;
  std::vector<PairNeed> needs;
};

Joined JoinCameras(const RigIndex& index, const std::vector<AlignedTrack>& tracks,
                   const std::vector<std::vector<int64_t>>& rig_times) {
  const size_t count = index.cameras.size();
  std::vector<std::vector<int>> common(count, std::vector<int>(count, 0));
  for (const Instant& instant : FindInstants(tracks, rig_times, 0).instants) {
    for (const InstantMember& a : instant.members) {
      for (const InstantMember& b : instant.members) {
        const auto x = static_cast<size_t>(index.camera_of_track[static_cast<size_t>(a.track)]);
        const auto y = static_cast<size_t>(index.camera_of_track[static_cast<size_t>(b.track)]);
        ++common[x][y];
      }
    }
  }
  Joined joined;
  joined.group_of_camera.resize(count);
  std::iota(joined.group_of_camera.begin(), joined.group_of_camera.end(), 0);
  const auto join = [&joined](int a, int b) {
    for (int& group : joined.group_of_camera) {
      if (group == b) group = a;
    }
  };
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = a + 1; b < count; ++b) {
      if (common[a][b] < kNeededInstants) continue;
      join(joined.group_of_camera[a], joined.group_of_camera[b]);
    }
  }
  std::map<int, int> sizes;
  for (const int group : joined.group_of_camera) ++sizes[group];
  joined.largest =
      std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; })->first;
  // What would join each further group with the least waving.
  std::vector<int> groups = joined.group_of_camera;
  while (true) {
    PairNeed need;
    int from = -1, to = -1;
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        if (groups[a] == groups[b] || (from >= 0 && common[a][b] <= need.common_count)) continue;
        need = {index.cameras[a].camera, index.cameras[b].camera, common[a][b], kNeededInstants};
        from = groups[b];
        to = groups[a];
      }
    }
    if (from < 0) break;
    std::ranges::replace(groups, from, to);
    joined.needs.push_back(std::move(need));
  }
  return joined;
}

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

class Estimator {
 public:
  explicit Estimator(RunningInput& input) : input_(input) {}

  absl::Status Run(RunningOutcome* outcome) {
    // Its grid and its advice are about a wand.
    if (input_.target.kind == TargetKind::kRigid) return absl::OkStatus();
    RefusalCounter refused;
    const int marker_count = input_.target.marker_count();
    std::erase_if(input_.tracks, [](const CameraTrack& track) { return !track.camera.intrinsics; });
    RigObservations all;
    all.target = input_.target;
    all.tracks =
        AlignClocks(input_.tracks, CleanTracks(&input_.tracks, marker_count, &refused), &refused);
    std::vector<ClockCorrection> clocks;
    all.index = IndexRig(all.tracks, &clocks);
    if (all.index.cameras.size() < 2) return absl::OkStatus();
    AdoptOffsets(&clocks);
    const Joined joined =
        JoinCameras(all.index, all.tracks, RigTimes(all.tracks, all.index, clocks));
    outcome->needs = joined.needs;
    // The group that is solved.
    for (size_t t = 0; t < all.tracks.size(); ++t) {
      const auto camera = static_cast<size_t>(all.index.camera_of_track[t]);
      if (joined.group_of_camera[camera] == joined.largest) rig_.tracks.push_back(all.tracks[t]);
    }
    rig_.target = input_.target;
    rig_.index = IndexRig(rig_.tracks, &clocks_);
    if (rig_.index.cameras.size() < 2) return absl::OkStatus();
    AdoptOffsets(&clocks_);
    options_.estimate_marker_positions = marker_count > 1;
    options_.cancelled = input_.cancelled;
    RIGCAL_RETURN_IF_ERROR(Solve());
    RIGCAL_ASSIGN_OR_RETURN(outcome->estimate, Report());
    return absl::OkStatus();
  }

 private:
  // The corrections of the last estimate, of those clocks that it had.
  void AdoptOffsets(std::vector<ClockCorrection>* clocks) const {
    for (ClockCorrection& clock : *clocks) {
      for (const ClockCorrection& known : input_.start.clocks) {
        if (known.session_id == clock.session_id && known.clock_id == clock.clock_id &&
            known.clock_epoch == clock.clock_epoch) {
          // The epoch of time is the first row's, which may have been thinned out since.
          clock.time_offset_s = known.At(clock.time_epoch_ns);
          clock.time_rate = known.time_rate;
        }
      }
    }
  }

  bool StartFits() const {
    const auto& known = input_.start.cameras;
    if (known.size() != rig_.index.cameras.size()) return false;
    for (size_t c = 0; c < known.size(); ++c) {
      if (known[c].name != rig_.index.cameras[c].camera) return false;
    }
    return true;
  }

  absl::Status Solve() {
    CountInstants();
    RIGCAL_RETURN_IF_ERROR(SolveOnce());
    RIGCAL_RETURN_IF_ERROR(ChooseIntrinsics());
    return input_.check_held_out ? CheckHeldOut() : absl::OkStatus();
  }

  bool MayRefine() const { return instant_count_ >= kMinRefineInstants; }

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

  // How many instants there are, and which of them are solved: every so many slots of time.
  void CountInstants() {
    const InstantList list =
        FindInstants(rig_.tracks, RigTimes(rig_.tracks, rig_.index, clocks_), 0);
    instant_count_ = static_cast<int>(list.instants.size());
    if (list.instants.empty()) return;
    origin_ns_ = list.instants.front().rig_time_ns;
    for (const Instant& instant : list.instants) {
      origin_ns_ = std::min(origin_ns_, instant.rig_time_ns);
    }
    size_t views = 0;
    for (const Instant& instant : list.instants) views += instant.members.size();
    const auto most = static_cast<size_t>(std::max(1, input_.max_views));
    stride_ = std::max<int64_t>(1, static_cast<int64_t>((views + most - 1) / most));
    // As wide as an instant every so often: the median step.
    std::vector<int64_t> steps;
    for (size_t i = 1; i < list.instants.size(); ++i) {
      steps.push_back(list.instants[i].rig_time_ns - list.instants[i - 1].rig_time_ns);
    }
    slot_ns_ = steps.empty() ? 1 : std::max<int64_t>(1, UpperMedian(&steps));
  }

  // One of so many of those that are solved.
  bool IsChosen(int64_t rig_time_ns, int64_t one_of = 1) const {
    const int64_t stride = one_of * stride_;
    return stride == 1 || ((rig_time_ns - origin_ns_) / slot_ns_) % stride == 0;
  }
  RigSolveOptions Thinned() const {
    RigSolveOptions options = options_;
    options.keep_instant = [this](int64_t t) { return IsChosen(t); };
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
    solution_ = *std::move(solution);
    options_.refine_intrinsics = false;
    uncertainty_.reset();
    return absl::OkStatus();
  }

  // One of four blocks of time is held out, another one each time: are the errors on it those that
  // the solution has elsewhere?
  absl::Status CheckHeldOut() {
    TimeBlocks blocks;
    blocks.origin_ns = origin_ns_;
    const int fold = input_.start.round % blocks.period;
    const auto is_held_out = [&](int64_t t) { return blocks.IsHeldOut(t, fold); };
    const auto held_out = std::ranges::count_if(solution_.built.instant_time_ns, is_held_out);
    if (held_out < kMinHeldOutInstants) return absl::OkStatus();
    // Some of them, and as many of those that are solved.
    const int64_t one_of = (held_out + kMaxHeldOutInstants - 1) / kMaxHeldOutInstants;
    const int other = (fold + 2) % blocks.period;
    RigSolveOptions options = options_;
    options.keep_instant = [&](int64_t t) { return blocks.IsKept(t, fold) && IsChosen(t); };
    const RigInitialization begin = InitializationFrom(solution_);
    const absl::StatusOr<RigSolution> solution = SolveRig(rig_, begin.clocks, options, &begin);
    if (absl::IsCancelled(solution.status())) return solution.status();
    if (!solution.ok()) return absl::OkStatus();
    const auto evaluate = [&](int remainder) {
      return EvaluateSolution(rig_, *solution, options, [&, remainder](int64_t t) {
        return blocks.IsHeldOut(t, remainder) && IsChosen(t, one_of);
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

  absl::StatusOr<RunningEstimate> Report() {
    const RigSolveOptions options = Thinned();
    const BundleProblem& problem = solution_.built.problem;
    if (!uncertainty_) {
      RIGCAL_ASSIGN_OR_RETURN(uncertainty_, ComputeUncertainty(solution_, options));
    }
    const RigUncertainty& uncertainty = *uncertainty_;
    RunningEstimate estimate;
    estimate.intrinsics_refined = options_.refine_intrinsics;
    estimate.instant_count = instant_count_;
    estimate.scale_known = IsMetric(rig_, options);
    estimate.marker_positions_m = problem.target.marker_positions_m;
    const double used_share = std::min(1.0, static_cast<double>(problem.instants.size()) /
                                                static_cast<double>(std::max(1, instant_count_)));
    const double share = used_share * std::clamp(input_.data_share, 1e-3, 1.0);
    estimate.scale_sigma_rel = std::sqrt(share) * uncertainty.scale_sigma_rel;
    const double noise_px = ReportCameras(uncertainty, share, &estimate);
    estimate.grid = MeasureWavedGrid(problem, input_.max_grid_points);
    const PointGains gains =
        ComputeGains(problem, rig_.index.cameras, uncertainty.parameters, estimate.grid, noise_px);
    estimate.error =
        ComputeExpectedError(gains, share * uncertainty.shape_covariance, estimate.grid);
    estimate.held_out = held_out_;
    if (input_.advise && estimate.scale_known) {
      estimate.advice = AdviseWaving(solution_, uncertainty, rig_.index.cameras, estimate.grid,
                                     gains, estimate.error, noise_px, share, {});
    }
    size_t newest = problem.instants.size();
    for (size_t i = 0; i < problem.instants.size(); ++i) {
      if (!problem.instants[i].used) continue;
      if (newest == problem.instants.size() ||
          solution_.built.instant_time_ns[i] > solution_.built.instant_time_ns[newest]) {
        newest = i;
      }
    }
    if (newest < problem.instants.size()) {
      for (const double s_m : problem.target.marker_positions_m) {
        estimate.wand_m.push_back(problem.instants[newest].origin_m +
                                  s_m * problem.instants[newest].direction);
      }
    }
    ReportStart(&estimate.next);
    return estimate;
  }

  // Returns the noise of a coordinate of a centre, pixels.
  double ReportCameras(const RigUncertainty& uncertainty, double share, RunningEstimate* estimate) {
    const BundleProblem& problem = solution_.built.problem;
    const std::vector<Residuals> residuals = ComputeResiduals(problem);
    std::vector<double> offsets_s;
    for (size_t k = 0; k < problem.clocks.size(); ++k) {
      offsets_s.push_back(solution_.clocks[k].time_offset_s + problem.clocks[k].time_offset_s);
    }
    const double median_s = Median(offsets_s);
    double square = 0, count = 0;
    for (size_t c = 0; c < problem.cameras.size(); ++c) {
      const auto track =
          static_cast<size_t>(std::ranges::find(rig_.index.camera_of_track, static_cast<int>(c)) -
                              rig_.index.camera_of_track.begin());
      const auto clock = static_cast<size_t>(rig_.index.clock_of_track[track]);
      std::vector<double> weights(problem.clocks.size(),
                                  -1.0 / static_cast<double>(problem.clocks.size()));
      weights[clock] += 1;
      EstimatedCamera camera;
      camera.name = problem.cameras[c].name;
      camera.cam_from_rig = problem.cameras[c].cam_from_rig;
      camera.time_offset_s = offsets_s[clock] - median_s;
      camera.time_offset_sigma_s =
          std::sqrt(share) * uncertainty.ClockSigma(ReducedParameterKind::kTimeOffset, weights);
      camera.reprojection_rms_px = residuals[c].inlier.rms_px;
      camera.focal_length_px = problem.cameras[c].intrinsics[0];
      camera.lens_disagrees = !lens_test_.disagrees.empty() && lens_test_.disagrees[c];
      estimate->cameras.push_back(std::move(camera));
      const double markers = residuals[c].inlier.marker_count;
      square += markers * residuals[c].inlier.rms_px * residuals[c].inlier.rms_px;
      count += markers;
    }
    return count > 0 && square > 0 ? std::sqrt(0.5 * square / count) : 0.3;
  }

  void ReportStart(EstimateStart* start) const {
    const BundleProblem& problem = solution_.built.problem;
    const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
    for (size_t c = 0; c < problem.cameras.size(); ++c) {
      start->cameras.push_back(
          {problem.cameras[c].name, problem.cameras[c].cam_from_rig, intrinsics[c]});
    }
    start->clocks = InitializationFrom(solution_).clocks;
    start->marker_positions_m = problem.target.marker_positions_m;
    start->round = input_.start.round + 1;
  }

  RunningInput& input_;
  RigObservations rig_;
  std::vector<ClockCorrection> clocks_;
  RigSolveOptions options_;
  RigSolution solution_;
  std::optional<RigUncertainty> uncertainty_;  // of solution_; none: not computed yet
  GivenIntrinsicsTest lens_test_;
  std::optional<HeldOutCheck> held_out_;
  int instant_count_ = 0;
  int64_t stride_ = 1, origin_ns_ = 0, slot_ns_ = 1;
};

}  // namespace

RunningOutcome EstimateNow(RunningInput input) {
  RunningOutcome outcome;
  try {
    outcome.problem = Estimator(input).Run(&outcome);
  } catch (const std::exception& error) {
    outcome.problem = absl::InternalError(absl::StrCat("running estimate: ", error.what()));
  }
  if (!outcome.problem.ok()) outcome.estimate.reset();
  return outcome;
}

}  // namespace rigcal::server
