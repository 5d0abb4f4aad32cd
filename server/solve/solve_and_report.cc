// SPDX-License-Identifier: Apache-2.0
#include "server/solve/solve_and_report.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/solve/clocks/time_search.h"
#include "server/solve/diagnose/odd_camera.h"
#include "server/solve/rig/held_rig.h"
#include "server/solve/time_search_report.h"

namespace rigcal::server {
namespace {

// Sigma, as a share of a known distance, with which the solver holds it.
constexpr double kDistanceHold = 1e-4;

// A mirrored image fits with no pose: told before everything is tried on it.
absl::Status CheckMirrored(const RigObservations& rig, const RigSolution& solution) {
  const BundleProblem& problem = solution.built.problem;
  const std::vector<int> doubted = MeasureAgreement(problem).doubted;
  if (doubted.empty() || 2 * doubted.size() > problem.cameras.size()) return absl::OkStatus();
  const OddCamera odd =
      JudgeCamera(rig, solution, problem.cameras[static_cast<size_t>(doubted.front())].name);
  if (odd.kind != FindingKind::kMirroredImage) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat("camera ", odd.camera, ": ", odd.advice));
}

// From the clocks as the search leaves them; where that cannot be solved, from the clocks as given:
// a search that went wrong must not cost a rig that was aligned.
absl::StatusOr<EvaluatedSolution> SearchAndSolve(const RigObservations& rig,
                                                 const std::vector<ClockCorrection>& clocks,
                                                 const RigSolveOptions& solve,
                                                 const CalibrationOptions& options) {
  const auto check = [&rig](const RigSolution& solution) { return CheckMirrored(rig, solution); };
  if (!solve.estimate_time_offsets) {
    return SolveAndEvaluate(rig, clocks, solve, options, nullptr, check);
  }
  const auto progress = [&solve](double fraction) {
    solve.progress(CalibrationStage::kSearchingTimeOffsets, fraction);
  };
  std::vector<ClockCorrection> found = clocks;
  TimeSearchOutcome searched;
  RIGCAL_RETURN_IF_ERROR(SearchTimeOffsets(rig, solve.reference_camera, {progress, solve.cancelled},
                                           &found, &searched));
  RIGCAL_RETURN_IF_ERROR(CheckDecided(rig, searched));
  absl::StatusOr<EvaluatedSolution> evaluated =
      SolveAndEvaluate(rig, found, solve, options, nullptr, check);
  if (evaluated.ok()) AddSearchFindings(rig, searched, &evaluated->findings);
  const bool moved = !std::equal(found.begin(), found.end(), clocks.begin(),
                                 [](const ClockCorrection& a, const ClockCorrection& b) {
                                   return a.time_offset_s == b.time_offset_s;
                                 });
  if (!absl::IsFailedPrecondition(evaluated.status())) return evaluated;
  if (moved) {
    absl::StatusOr<EvaluatedSolution> as_given =
        SolveAndEvaluate(rig, clocks, solve, options, nullptr, check);
    if (as_given.ok() || absl::IsCancelled(as_given.status())) return as_given;
  }
  if (searched.period_s > 0) return WithPeriod(evaluated.status(), searched.period_s);
  return evaluated;
}

}  // namespace

int CameraIndex(const RigIndex& index, const std::string& name) {
  const auto found = std::ranges::find(index.cameras, name, &CameraDescription::camera);
  return found == index.cameras.end() ? 0 : static_cast<int>(found - index.cameras.begin());
}

bool KeepsIntrinsics(const CalibrationOptions& options, const std::string& camera) {
  return std::ranges::find(options.fixed_intrinsics, camera) != options.fixed_intrinsics.end();
}

RigSolveOptions SolveOptionsOf(const RigObservations& rig, const CalibrationOptions& options,
                               const CalibrationHooks& hooks,
                               const std::map<std::string, CameraCounts>& counts,
                               std::shared_ptr<const HeldRig> held) {
  RigSolveOptions solve;
  solve.held = std::move(held);
  solve.reference_camera = CameraIndex(rig.index, options.reference_camera);
  solve.estimate_time_offsets = options.time_offsets != Estimate::kFixed;
  solve.estimate_marker_positions =
      options.marker_positions != Estimate::kFixed && rig.Parts().HasLengths();
  if (options.known_distance) {
    const KnownDistance& known = *options.known_distance;
    solve.known_distance = BundleDistance{CameraIndex(rig.index, known.camera_a),
                                          CameraIndex(rig.index, known.camera_b), known.distance_m,
                                          kDistanceHold * known.distance_m};
    solve.known_distance_sigma_m = known.SigmaM();
  }
  solve.sigma_px = options.sigma_px;
  solve.tolerance_s = options.association_tolerance_s;
  solve.seed = options.seed;
  solve.progress = [&hooks](CalibrationStage stage, double fraction) {
    if (hooks.progress) hooks.progress(stage, fraction);
  };
  solve.cancelled = hooks.cancelled;
  for (size_t c = 0; c < rig.index.cameras.size(); ++c) {
    const std::string& camera = rig.index.cameras[c].camera;
    solve.camera_notes.push_back(absl::StrCat(counts.at(camera).wand_count, " wand views"));
    const bool is_held = solve.held != nullptr && solve.held->Holds(c);
    solve.keep_intrinsics.push_back(is_held || KeepsIntrinsics(options, camera));
  }
  return solve;
}

absl::StatusOr<Solved> SolveAndReport(const RigObservations& rig,
                                      const std::vector<ClockCorrection>& clocks,
                                      const RigSolveOptions& solve,
                                      const CalibrationOptions& options,
                                      const std::map<std::string, CameraCounts>& counts,
                                      const RefusalCounter& refused) {
  Solved solved;
  RIGCAL_ASSIGN_OR_RETURN(solved.evaluated, SearchAndSolve(rig, clocks, solve, options));
  solve.progress(CalibrationStage::kReporting, 1);
  solved.refused = refused;
  RIGCAL_ASSIGN_OR_RETURN(solved.result, ReportCalibration({rig, solved.evaluated, options, counts},
                                                           &solved.refused, &solved.courses));
  return solved;
}

}  // namespace rigcal::server
