// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/rolling_shutters.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/solve/rig/line_delays.h"

namespace rigcal::server {
namespace {

constexpr double kStandOutSigmas = 5;
constexpr double kMinReadoutS = 0.5e-3;  // of the whole image; less is no matter to a wand's speed
constexpr double kMinCostShare = 0.02;   // of the robust cost that the delays must explain
constexpr int kMaxPasses = 4;
constexpr size_t kEnoughMarkers = 20'000;  // to see whether there is a rolling shutter at all
constexpr double kSettledSigmas = 0.02;

// Those that do not stand out become zero. Returns whether any does.
bool KeepThoseThatStandOut(const RigObservations& rig, LineDelayEstimate* estimate) {
  bool any = false;
  for (size_t c = 0; c < estimate->cameras.size(); ++c) {
    LineDelay& delay = estimate->cameras[c];
    const double size_s = std::abs(delay.line_delay_s);
    const bool stands_out = delay.sigma_s > 0 && size_s > kStandOutSigmas * delay.sigma_s &&
                            size_s * rig.index.cameras[c].image_size_px.height > kMinReadoutS;
    if (!stands_out) delay = {};
    any = any || stands_out;
  }
  return any && estimate->cost_share > kMinCostShare;
}

void Add(const std::vector<LineDelay>& more, RigObservations* rig, std::vector<LineDelay>* total) {
  AddLineDelays(more, rig);
  for (size_t c = 0; c < more.size(); ++c) (*total)[c].line_delay_s += more[c].line_delay_s;
}

std::vector<LineDelay> Negative(std::vector<LineDelay> delays) {
  for (LineDelay& delay : delays) delay.line_delay_s = -delay.line_delay_s;
  return delays;
}

// Solves with the rows' times corrected until the corrections are settled; `total` becomes what was
// added, with sigmas. Returns the last solution's estimates.
absl::StatusOr<RigInitialization> SettleLineDelays(const RigSolveOptions& options,
                                                   const RigInitialization& first,
                                                   std::vector<LineDelay> correction,
                                                   RigObservations* rig,
                                                   std::vector<LineDelay>* total) {
  RigInitialization initial = first;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    Add(correction, rig, total);
    RIGCAL_ASSIGN_OR_RETURN(const RigSolution solution,
                            SolveRig(*rig, initial.clocks, options, &initial));
    initial = InitializationFrom(solution);
    RIGCAL_ASSIGN_OR_RETURN(const LineDelayEstimate left,
                            EstimateLineDelays(*rig, options, solution));
    bool settled = true;
    for (size_t c = 0; c < total->size(); ++c) {
      // Only cameras that were found to roll.
      const bool rolls = correction[c].sigma_s > 0;
      correction[c] = rolls ? left.cameras[c] : LineDelay();
      (*total)[c].sigma_s = correction[c].sigma_s;
      settled =
          settled && std::abs(correction[c].line_delay_s) <= kSettledSigmas * correction[c].sigma_s;
    }
    if (settled) break;
  }
  return initial;
}

Finding ModelledFinding(const std::string& camera, const LineDelay& delay, double rows) {
  return {FindingKind::kRollingShutter, camera, 1e6 * delay.line_delay_s, "us",
          absl::StrFormat("its image rows are taken one after the other, %.2f us apart (+-%.2f "
                          "us), %.1f ms over the image; the calibration takes this into account",
                          1e6 * delay.line_delay_s, 1e6 * delay.sigma_s,
                          1e3 * std::abs(delay.line_delay_s) * rows)};
}

}  // namespace

absl::StatusOr<EvaluatedSolution> ModelRollingShutters(const RigSolveOptions& base,
                                                       const CalibrationOptions& options,
                                                       EvaluatedSolution evaluated,
                                                       RigObservations* rig) {
  if (!base.estimate_time_offsets) return evaluated;
  absl::StatusOr<LineDelayEstimate> found =
      EstimateLineDelays(*rig, evaluated.options, evaluated.solution, kEnoughMarkers);
  if (absl::IsCancelled(found.status())) return found.status();
  if (!found.ok() || !KeepThoseThatStandOut(*rig, &*found)) return evaluated;
  const RigInitialization first = InitializationFrom(evaluated.solution);
  PutAway(*rig, evaluated.options, &evaluated.solution);
  std::vector<LineDelay> total(found->cameras.size());
  absl::StatusOr<RigInitialization> settled =
      SettleLineDelays(evaluated.options, first, std::move(found->cameras), rig, &total);
  absl::StatusOr<EvaluatedSolution> modelled =
      settled.ok() ? SolveAndEvaluate(*rig, settled->clocks, base, options, &*settled)
                   : absl::StatusOr<EvaluatedSolution>(settled.status());
  if (absl::IsCancelled(modelled.status())) return modelled.status();
  if (!modelled.ok()) {
    AddLineDelays(Negative(std::move(total)), rig);
    TakeBack(*rig, evaluated.options, &evaluated.solution);
    return evaluated;
  }
  for (size_t c = 0; c < total.size(); ++c) {
    if (!(total[c].sigma_s > 0)) continue;
    const CameraDescription& camera = rig->index.cameras[c];
    modelled->findings.push_back(
        ModelledFinding(camera.camera, total[c], camera.image_size_px.height));
  }
  modelled->line_delays = std::move(total);
  return modelled;
}

}  // namespace rigcal::server
