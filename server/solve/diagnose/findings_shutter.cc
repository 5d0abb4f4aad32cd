// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

constexpr double kShutterSigmas = 5;
constexpr double kMinReadoutS = 0.5e-3;  // of the whole image; less is no matter to a wand's speed
// Of the camera's error; less is enough where it stands out by so much more. A slow wand hides it.
constexpr double kMinShutterGain = 0.03;
constexpr double kMinClearGain = 0.01, kClearSigmas = 15;

double ImageHeightPx(const CauseInput& input, size_t camera) {
  return input.rig.index.cameras[input.trial.rig_camera[camera]].image_size_px.height;
}

// Every marker becomes an observation of its own, stamped by a clock of its camera whose time is
// the marker's image row: the clock's rate is then the line time. `keep_drift` false: the rates
// that the solve gave to the clocks are taken back; over a short recording the rows' times look
// like a drift.
BundleProblem WithRowClocks(const CauseInput& input, bool keep_drift,
                            std::vector<int>* camera_of_clock) {
  const BundleProblem& from = input.trial.problem;
  BundleProblem problem = from;
  problem.clocks.clear();
  problem.observations.clear();
  std::map<std::pair<int, int>, int> clock_of;  // by camera and clock
  for (BundleInstant& instant : problem.instants) {
    const int first = instant.first_observation, count = instant.observation_count;
    instant.first_observation = static_cast<int>(problem.observations.size());
    for (int o = first; o < first + count; ++o) {
      BundleObservation observation = from.observations[static_cast<size_t>(o)];
      const BundleClock& clock = from.clocks[static_cast<size_t>(observation.clock)];
      const auto [entry, inserted] = clock_of.try_emplace({observation.camera, observation.clock},
                                                          static_cast<int>(problem.clocks.size()));
      if (inserted) {
        problem.clocks.push_back(clock);
        problem.clocks.back().time_rate = 0;
        problem.clocks.back().rate_fixed = false;
        problem.clocks.back().rate_sigma = 0;
        camera_of_clock->push_back(observation.camera);
      }
      const double rate_to_take_out =
          keep_drift
              ? clock.time_rate
              : -input.evaluated.solution.clocks[static_cast<size_t>(observation.clock)].time_rate;
      const double drift_s = rate_to_take_out * observation.clock_time_s;
      const double middle_row = 0.5 * ImageHeightPx(input, static_cast<size_t>(observation.camera));
      observation.clock = entry->second;
      const int first_marker = observation.first_marker, markers = observation.marker_count;
      for (int m = first_marker; m < first_marker + markers; ++m) {
        BundleMarker& marker = problem.markers[static_cast<size_t>(m)];
        marker.centre_px -= drift_s * marker.velocity_px_s;
        observation.clock_time_s = marker.centre_px.y() - middle_row;
        observation.first_marker = m;
        observation.marker_count = 1;
        problem.observations.push_back(observation);
      }
    }
    instant.observation_count =
        static_cast<int>(problem.observations.size()) - instant.first_observation;
  }
  // A problem wants a clock that is wholly fixed; nothing is stamped by this one.
  problem.clocks.emplace_back();
  return problem;
}

// The trial's problem with every marker of these clocks' cameras moved to the time of its row.
BundleProblem WithoutRowTimes(const BundleProblem& plain, const BundleProblem& by_row,
                              const std::vector<bool>& apply) {
  BundleProblem problem = plain;
  for (size_t m = 0; m < problem.markers.size(); ++m) {
    problem.markers[m].centre_px = by_row.markers[m].centre_px;
  }
  // The drift is in the centres, one way or the other.
  for (BundleClock& clock : problem.clocks) {
    clock.time_rate = 0;
    clock.rate_fixed = true;
  }
  ForEachMarker(by_row, [&](size_t, const BundleObservation& observation, size_t m) {
    const auto k = static_cast<size_t>(observation.clock);
    if (!apply[k]) return;
    BundleMarker& marker = problem.markers[m];
    marker.centre_px -=
        by_row.clocks[k].time_rate * observation.clock_time_s * marker.velocity_px_s;
  });
  return problem;
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
  std::vector<int> camera_of_clock;
  BundleProblem by_row = WithRowClocks(input, true, &camera_of_clock);
  if (!SolveTrialFromAfar(input.trial.bundle, &by_row).ok()) return repair;
  if (input.evaluated.options.estimate_time_rates) {
    std::vector<int> same;
    BundleProblem undone = WithRowClocks(input, false, &same);
    if (SolveTrialFromAfar(input.trial.bundle, &undone).ok() &&
        Overall(CompareErrors(by_row, undone)).gain_px() > 0) {
      by_row = std::move(undone);
    }
  }
  const auto sigmas = ComputeSigmas(input.trial.bundle, by_row);
  if (!sigmas.ok()) return repair;
  const std::vector<ErrorChange> changes = CompareErrors(input.trial.problem, by_row);
  std::vector<bool> apply(by_row.clocks.size(), false);
  for (size_t k = 0; k < camera_of_clock.size(); ++k) {
    const auto c = static_cast<size_t>(camera_of_clock[k]);
    const double line_time_s = by_row.clocks[k].time_rate;
    const double sigma_s = sigmas->Of({ReducedParameterKind::kTimeRate, static_cast<int>(k), 0});
    const double rows = ImageHeightPx(input, c);
    const double must_gain =
        std::abs(line_time_s) > kClearSigmas * sigma_s ? kMinClearGain : kMinShutterGain;
    if (!(std::abs(line_time_s) > kShutterSigmas * sigma_s) ||
        !(std::abs(line_time_s) * rows > kMinReadoutS) || changes[c].gain() < must_gain) {
      continue;
    }
    apply[k] = true;
    const std::string& camera = by_row.cameras[c].name;
    const bool known = std::ranges::any_of(
        repair.causes, [&camera](const Cause& cause) { return cause.finding.camera == camera; });
    if (known) continue;  // in another session, or before it moved
    repair.causes.push_back({{FindingKind::kRollingShutter, camera, 1e6 * line_time_s, "us",
                              Advice(line_time_s, sigma_s, rows, changes[c])},
                             changes[c].gain_px()});
  }
  if (repair.causes.empty()) return repair;
  repair.repaired = input.trial;
  repair.repaired.problem = WithoutRowTimes(input.trial.problem, by_row, apply);
  if (!SolveTrial(input.trial.bundle, &repair.repaired.problem).ok()) repair.causes.clear();
  return repair;
}

}  // namespace rigcal::server
