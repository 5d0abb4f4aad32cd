// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"
#include "server/solve/rig/stamp_jitter.h"

namespace rigcal::server {
namespace {

constexpr double kShutterSigmas = 5;
constexpr double kLineDelayPriorS = 1e-4;  // one sigma; rows are read in 5 to 60 us
constexpr double kMinReadoutS = 0.5e-3;  // of the whole image; less is no matter to a wand's speed
// Of the camera's error; less is enough where it stands out by so much more. A slow wand hides it.
constexpr double kMinShutterGain = 0.03;
constexpr double kMinClearGain = 0.01, kClearSigmas = 15;

double ImageHeightPx(const CauseInput& input, size_t camera) {
  return input.rig.index.cameras[input.trial.rig_camera[camera]].image_size_px.height;
}

// The trial's problem with line delays free. Not `keep_drift`: the rates that the solve gave to the
// clocks are taken back; over a short recording the rows' times look like a drift.
BundleProblem WithLineDelays(const CauseInput& input, const std::set<std::string>& without,
                             bool keep_drift) {
  BundleProblem problem = input.trial.problem;
  for (BundleCamera& camera : problem.cameras) {
    if (without.contains(camera.name)) continue;
    camera.line_delay_fixed = false;
    camera.line_delay_sigma_s = kLineDelayPriorS;
  }
  for (size_t k = 0; k < problem.clocks.size() && !keep_drift; ++k) {
    problem.clocks[k].time_rate = -input.evaluated.solution.clocks[k].time_rate;
    problem.clocks[k].rate_fixed = true;
  }
  return problem;
}

// Cameras whose stamps scatter from row to row, which bends what image rows explain.
std::set<std::string> JitteringCameras(const BundleProblem& problem) {
  std::set<std::string> names;
  if (problem.HasRigidTarget()) return names;
  const std::vector<bool> jitters = CamerasThatJitter(MeasureStampJitter(problem));
  for (size_t c = 0; c < jitters.size(); ++c) {
    if (jitters[c]) names.insert(problem.cameras[c].name);
  }
  return names;
}

std::string Advice(double line_time_s, double sigma_s, double rows, const ErrorChange& change) {
  return absl::StrFormat(
      "its image rows are taken one after the other, %.2f us apart (+-%.2f us), %.1f ms over the "
      "image; its error is %.2f px, and %.2f px with this taken into account. Use a global shutter "
      "mode or camera, or wave the wand more slowly",
      1e6 * line_time_s, 1e6 * sigma_s, 1e3 * std::abs(line_time_s) * rows, change.before_px,
      change.after_px);
}

}  // namespace

Repair RepairRollingShutters(const CauseInput& input) {
  Repair repair;
  // Where line delays are estimated they are taken out.
  if (!input.evaluated.options.estimate_line_delays.empty()) return repair;
  const std::set<std::string> jitter = JitteringCameras(input.evaluated.solution.built.problem);
  if (jitter.size() == input.rig.index.cameras.size()) return repair;
  BundleProblem rolling = WithLineDelays(input, jitter, true);
  if (!SolveTrialFromAfar(input.trial.bundle, &rolling).ok()) return repair;
  if (input.evaluated.options.estimate_time_rates) {
    BundleProblem undone = WithLineDelays(input, jitter, false);
    if (SolveTrialFromAfar(input.trial.bundle, &undone).ok() &&
        Overall(CompareErrors(rolling, undone)).gain_px() > 0) {
      rolling = std::move(undone);
    }
  }
  const auto sigmas = ComputeSigmas(input.trial.bundle, rolling);
  if (!sigmas.ok()) return repair;
  const std::vector<ErrorChange> changes = CompareErrors(input.trial.problem, rolling);
  for (size_t c = 0; c < rolling.cameras.size(); ++c) {
    BundleCamera& camera = rolling.cameras[c];
    if (camera.line_delay_fixed) continue;
    const double sigma_s = sigmas->Of({ReducedParameterKind::kLineDelay, static_cast<int>(c), 0});
    const double rows = ImageHeightPx(input, c);
    const double size_s = std::abs(camera.line_delay_s);
    const double must_gain = size_s > kClearSigmas * sigma_s ? kMinClearGain : kMinShutterGain;
    const bool stands_out = size_s > kShutterSigmas * sigma_s && size_s * rows > kMinReadoutS &&
                            changes[c].gain() >= must_gain;
    camera.line_delay_fixed = true;
    if (!stands_out) {
      camera.line_delay_s = 0;
      continue;
    }
    const bool known = std::ranges::any_of(repair.causes, [&camera](const Cause& cause) {
      return cause.finding.camera == camera.name;
    });
    if (known) continue;  // before it moved
    repair.causes.push_back({{FindingKind::kRollingShutter, camera.name, 1e6 * camera.line_delay_s,
                              "us", Advice(camera.line_delay_s, sigma_s, rows, changes[c])},
                             changes[c].gain_px()});
  }
  if (repair.causes.empty()) return repair;
  repair.repaired = input.trial;
  repair.repaired.problem = std::move(rolling);
  if (!SolveTrial(input.trial.bundle, &repair.repaired.problem).ok()) repair.causes.clear();
  return repair;
}

}  // namespace rigcal::server
