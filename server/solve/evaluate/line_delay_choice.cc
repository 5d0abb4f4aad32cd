// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/line_delay_choice.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/rig/line_delay_limit.h"
#include "server/solve/rig/line_delays.h"
#include "server/solve/rig/outliers.h"
#include "server/solve/rig/put_away.h"
#include "server/solve/rig/rig_solver.h"
#include "server/solve/rig/stamp_jitter.h"

namespace rigcal::server {
namespace {

constexpr double kMayLoseMarkers = 0.05;  // of all markers
// Of a rolling shutter that is named: sigmas of its line delay, and the time over the image.
constexpr double kShutterSigmas = 8, kMinReadoutS = 2e-3;

Finding AtLimit(const CameraDescription& camera, double delay_s) {
  return {FindingKind::kRollingShutter, camera.camera, 1e6 * delay_s, "us",
          absl::StrFormat("its image rows are taken one after the other, %.2f us apart, %.1f ms "
                          "over the image: the whole period of its frames, which is the longest "
                          "that is possible, and at which it is held. Its rows would fit better "
                          "with more: check its frame rate, its lens and its stamps",
                          1e6 * delay_s, 1e3 * std::abs(delay_s) * camera.image_size_px.height)};
}

// The solution with line delays where a rolling shutter stands out, of cameras that are not in
// `without`; `options` become its own. None where nothing stands out or it cannot be solved so.
// `solution` may be put away. CANCELLED.
absl::StatusOr<std::optional<RigSolution>> SolveWithDelays(const RigObservations& rig,
                                                           const std::vector<bool>& without,
                                                           RigSolution* solution,
                                                           RigSolveOptions* options) {
  std::vector<int> heights_px;
  for (const CameraDescription& camera : rig.index.cameras) {
    heights_px.push_back(camera.image_size_px.height);
  }
  std::vector<LineDelay> delays;
  const absl::StatusOr<std::vector<bool>> roll = FindRollingShutters(
      solution->built.problem, heights_px, without, options->cancelled, &delays);
  if (absl::IsCancelled(roll.status())) return roll.status();
  if (!roll.ok() || roll->empty()) return std::nullopt;
  RigInitialization initial = InitializationFrom(*solution);
  for (size_t c = 0; c < roll->size(); ++c) {
    if ((*roll)[c]) initial.line_delay_s[c] += delays[c].line_delay_s;
  }
  const double share = InlierShare(solution->built.problem);
  PutAway(rig, *options, solution);
  options->estimate_line_delays = *roll;
  absl::StatusOr<RigSolution> tried = SolveRig(rig, initial.clocks, *options, &initial);
  if (tried.ok() && !tried->converged) {
    initial = InitializationFrom(*tried);
    absl::StatusOr<RigSolution> further = SolveRig(rig, initial.clocks, *options, &initial);
    if (further.ok()) tried = std::move(further);
  }
  if (absl::IsCancelled(tried.status())) return tried.status();
  if (!tried.ok() || InlierShare(tried->built.problem) < share - kMayLoseMarkers) {
    return std::nullopt;
  }
  return *std::move(tried);
}

std::vector<bool> JitterOf(const RigSolution& solution) {
  return CamerasThatJitter(MeasureStampJitter(solution.built.problem));
}

}  // namespace

absl::Status TryLineDelays(const RigObservations& rig, RigSolveOptions* options,
                           RigSolution* solution) {
  // Rolling shutters pull the target, so that a camera beside them seems to have stamps that
  // jitter; and the other way round. What is left with all line delays free says which it is.
  std::vector<bool> jitters = JitterOf(*solution);
  RigSolveOptions with_delays = *options;
  RIGCAL_ASSIGN_OR_RETURN(std::optional<RigSolution> tried,
                          SolveWithDelays(rig, {}, solution, &with_delays));
  if (tried) {
    if (const std::vector<bool> still = JitterOf(*tried); std::ranges::count(still, true) > 0) {
      jitters = still;
      tried.reset();
    }
  }
  const auto jitter_count = std::ranges::count(jitters, true);
  if (!tried && jitter_count > 0 && jitter_count < std::ssize(jitters)) {
    with_delays = *options;
    TakeBack(rig, *options, solution);
    RIGCAL_ASSIGN_OR_RETURN(tried, SolveWithDelays(rig, jitters, solution, &with_delays));
  }
  if (!tried) return absl::OkStatus();
  *options = std::move(with_delays);
  *solution = *std::move(tried);
  return absl::OkStatus();
}

std::vector<Finding> RollingShutterFindings(const RigObservations& rig,
                                            const RigSolveOptions& options,
                                            const RigSolution& solution,
                                            const RigUncertainty& uncertainty) {
  std::vector<Finding> findings;
  const RigInitialization solved = InitializationFrom(solution);
  const std::vector<double> longest_s = LongestLineDelays(rig);
  for (size_t c = 0; c < options.estimate_line_delays.size(); ++c) {
    const Eigen::Index row =
        uncertainty.Row({ReducedParameterKind::kLineDelay, static_cast<int>(c), 0});
    const double delay_s = solved.line_delay_s[c];
    if (row < 0 && options.estimate_line_delays[c] && IsAtLimit(delay_s, longest_s[c])) {
      findings.push_back(AtLimit(rig.index.cameras[c], delay_s));
    }
    if (row < 0) continue;
    const double sigma_s = std::sqrt(uncertainty.covariance(row, row));
    const double readout_s = std::abs(delay_s) * rig.index.cameras[c].image_size_px.height;
    if (std::abs(delay_s) < kShutterSigmas * sigma_s || readout_s < kMinReadoutS) continue;
    findings.push_back(
        {FindingKind::kRollingShutter, rig.index.cameras[c].camera, 1e6 * delay_s, "us",
         absl::StrFormat("its image rows are taken one after the other, %.2f us apart (+-%.2f us), "
                         "%.1f ms over the image; the calibration takes this into account",
                         1e6 * delay_s, 1e6 * sigma_s, 1e3 * readout_s)});
  }
  return findings;
}

absl::Status DropLineDelays(const RigObservations& rig, RigSolveOptions* options,
                            RigSolution* solution, RigUncertainty* uncertainty) {
  RigInitialization initial = InitializationFrom(*solution);
  initial.line_delay_s.clear();
  RigSolveOptions without = *options;
  without.estimate_line_delays.clear();
  absl::StatusOr<RigSolution> solved = SolveRig(rig, initial.clocks, without, &initial);
  if (absl::IsCancelled(solved.status())) return solved.status();
  if (!solved.ok()) return absl::OkStatus();
  absl::StatusOr<RigUncertainty> found = ComputeUncertainty(*solved, without);
  if (!found.ok()) return absl::OkStatus();
  *solution = *std::move(solved);
  *uncertainty = *std::move(found);
  *options = std::move(without);
  return absl::OkStatus();
}

}  // namespace rigcal::server
