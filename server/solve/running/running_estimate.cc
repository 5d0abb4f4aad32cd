// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/running_estimate.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/refusal.h"
#include "common/status/status_macros.h"
#include "server/associate/align_clocks.h"
#include "server/associate/clean_track.h"
#include "server/associate/straight_clocks.h"
#include "server/solve/evaluate/error_figures.h"
#include "server/solve/evaluate/uncertainty.h"
#include "server/solve/rig/rig_observations.h"
#include "server/solve/rig/rig_solution.h"
#include "server/solve/rig/rig_solve_options.h"
#include "server/solve/running/running_solve.h"

namespace rigcal::server {
namespace {

// The corrections of the last estimate, of those clocks that it had.
void AdoptOffsets(const EstimateStart& start, std::vector<ClockCorrection>* clocks) {
  for (ClockCorrection& clock : *clocks) {
    for (const ClockCorrection& known : start.clocks) {
      if (known.session_id == clock.session_id && known.clock_id == clock.clock_id &&
          known.clock_epoch == clock.clock_epoch) {
        // The epoch of time is the first row's, which may have been thinned out since.
        clock.time_offset_s = known.At(clock.time_epoch_ns);
        clock.time_rate = known.time_rate;
      }
    }
  }
}

// Cameras, and the noise of a coordinate of a centre, pixels. `share`: of all data, that was
// solved.
double ReportCameras(const RunningSolution& solved, double share, RunningEstimate* estimate) {
  const RigIndex& index = solved.rig.index;
  const BundleProblem& problem = solved.solution.built.problem;
  const std::vector<Residuals> residuals = ComputeResiduals(problem);
  std::vector<double> offsets_s;
  for (size_t k = 0; k < problem.clocks.size(); ++k) {
    offsets_s.push_back(solved.solution.clocks[k].time_offset_s + problem.clocks[k].time_offset_s);
  }
  const double median_s = Median(offsets_s);
  double square = 0, count = 0;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const auto track =
        static_cast<size_t>(std::ranges::find(index.camera_of_track, static_cast<int>(c)) -
                            index.camera_of_track.begin());
    const auto clock = static_cast<size_t>(index.clock_of_track[track]);
    std::vector<double> weights(problem.clocks.size(),
                                -1.0 / static_cast<double>(problem.clocks.size()));
    weights[clock] += 1;
    EstimatedCamera camera;
    camera.name = problem.cameras[c].name;
    camera.cam_from_rig = problem.cameras[c].cam_from_rig;
    camera.time_offset_s = offsets_s[clock] - median_s;
    camera.time_offset_sigma_s = std::sqrt(share) * solved.uncertainty.ClockSigma(
                                                        ReducedParameterKind::kTimeOffset, weights);
    camera.reprojection_rms_px = residuals[c].inlier.rms_px;
    camera.focal_length_px = problem.cameras[c].intrinsics[0];
    camera.lens_disagrees = !solved.lens_test.disagrees.empty() && solved.lens_test.disagrees[c];
    estimate->cameras.push_back(std::move(camera));
    const double markers = residuals[c].inlier.marker_count;
    square += markers * residuals[c].inlier.rms_px * residuals[c].inlier.rms_px;
    count += markers;
  }
  return count > 0 && square > 0 ? std::sqrt(0.5 * square / count) : 0.3;
}

// Its markers at the newest instant, rig frame; empty: no instant was used.
std::vector<Eigen::Vector3d> NewestWand(const BuiltProblem& built) {
  const std::vector<BundleInstant>& instants = built.problem.instants;
  size_t newest = instants.size();
  for (size_t i = 0; i < instants.size(); ++i) {
    if (!instants[i].used) continue;
    if (newest == instants.size() || built.instant_time_ns[i] > built.instant_time_ns[newest]) {
      newest = i;
    }
  }
  std::vector<Eigen::Vector3d> wand_m;
  if (newest == instants.size()) return wand_m;
  for (const double s_m : built.problem.target.marker_positions_m) {
    wand_m.push_back(instants[newest].origin_m + s_m * instants[newest].direction);
  }
  return wand_m;
}

EstimateStart NextStart(const RigSolution& solution, int round) {
  const BundleProblem& problem = solution.built.problem;
  const std::vector<Intrinsics> intrinsics = CurrentIntrinsics(problem);
  EstimateStart start;
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    start.cameras.push_back(
        {problem.cameras[c].name, problem.cameras[c].cam_from_rig, intrinsics[c]});
  }
  start.clocks = InitializationFrom(solution).clocks;
  start.marker_positions_m = problem.target.marker_positions_m;
  start.round = round;
  return start;
}

RunningEstimate Report(const RunningSolution& solved, const RunningInput& input) {
  const std::vector<CameraDescription>& cameras = solved.rig.index.cameras;
  const BundleProblem& problem = solved.solution.built.problem;
  const RigUncertainty& uncertainty = solved.uncertainty;
  RunningEstimate estimate;
  estimate.intrinsics_refined = solved.options.refine_intrinsics;
  estimate.instant_count = solved.instant_count;
  estimate.scale_known = IsMetric(solved.rig, solved.options);
  estimate.marker_positions_m = problem.target.marker_positions_m;
  const double used_share =
      std::min(1.0, static_cast<double>(problem.instants.size()) /
                        static_cast<double>(std::max(1, solved.instant_count)));
  const double share = used_share * std::clamp(input.data_share, 1e-3, 1.0);
  estimate.scale_sigma_rel = std::sqrt(share) * uncertainty.scale_sigma_rel;
  const double noise_px = ReportCameras(solved, share, &estimate);
  estimate.grid = MeasureWavedGrid(problem, input.max_grid_points);
  const PointGains gains =
      ComputeGains(problem, cameras, uncertainty.parameters, estimate.grid, noise_px);
  estimate.error = ComputeExpectedError(gains, share * uncertainty.shape_covariance, estimate.grid);
  // More waving does not mend lenses that are kept.
  const ExpectedError by_noise = estimate.error;
  if (solved.lenses_kept.spread > 0) {
    RigUncertainty of_all_data = uncertainty;
    of_all_data.covariance *= share;
    of_all_data.shape_covariance *= share;
    const RigUncertainty all = WithKeptLenses(of_all_data, solved.lenses_kept);
    estimate.error = ComputeExpectedError(
        ComputeGains(problem, cameras, all.parameters, estimate.grid, noise_px),
        all.shape_covariance, estimate.grid);
  }
  estimate.held_out = solved.held_out;
  if (input.advise && estimate.scale_known) {
    estimate.advice = AdviseWaving(solved.solution, uncertainty, cameras, estimate.grid, gains,
                                   by_noise, noise_px, share, {});
  }
  estimate.wand_m = NewestWand(solved.solution.built);
  estimate.next = NextStart(solved.solution, input.start.round + 1);
  return estimate;
}

absl::Status RunEstimate(RunningInput* input, RunningOutcome* outcome) {
  // Its grid and its advice are about a wand.
  if (!input->target.IsLine()) return absl::OkStatus();
  RefusalCounter refused;
  const int marker_count = input->target.marker_count();
  std::erase_if(input->tracks, [](const CameraTrack& track) { return !track.camera.intrinsics; });
  StraightenClocks(&input->tracks, &refused);
  const std::vector<AlignedTrack> all =
      AlignClocks(input->tracks, CleanTracks(&input->tracks, marker_count, &refused), &refused);
  std::vector<ClockCorrection> clocks;
  const RigIndex index = IndexRig(all, &clocks);
  if (index.cameras.size() < 2) return absl::OkStatus();
  AdoptOffsets(input->start, &clocks);
  CameraGroups groups = GroupCameras(index, all, RigTimes(all, index, clocks));
  outcome->needs = std::move(groups.needs);
  RigObservations rig;
  rig.target = input->target;
  for (size_t t = 0; t < all.size(); ++t) {
    const auto camera = static_cast<size_t>(index.camera_of_track[t]);
    if (groups.group_of_camera[camera] == groups.largest) rig.tracks.push_back(all[t]);
  }
  std::vector<ClockCorrection> rig_clocks;
  rig.index = IndexRig(rig.tracks, &rig_clocks);
  if (rig.index.cameras.size() < 2) return absl::OkStatus();
  AdoptOffsets(input->start, &rig_clocks);
  RIGCAL_ASSIGN_OR_RETURN(const RunningSolution solved,
                          SolveRunning(std::move(rig), std::move(rig_clocks), *input));
  outcome->estimate = Report(solved, *input);
  return absl::OkStatus();
}

}  // namespace

RunningOutcome EstimateNow(RunningInput input) {
  RunningOutcome outcome;
  try {
    outcome.problem = RunEstimate(&input, &outcome);
  } catch (const std::exception& error) {
    outcome.problem = absl::InternalError(absl::StrCat("running estimate: ", error.what()));
  }
  if (!outcome.problem.ok()) outcome.estimate.reset();
  return outcome;
}

}  // namespace rigcal::server
