// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "server/solve/diagnose/finding_causes.h"

namespace rigcal::server {
namespace {

// Of a camera's sightings that are in the span, and of those in it that are lost.
constexpr double kMinSpanShare = 0.1;
constexpr double kMinLostShare = 0.6;
constexpr size_t kMinLost = 20;
constexpr int kMinOthers = 2;
constexpr double kNearPeriods = 0.5;

// A view of the wand at a time when the others have placed it.
struct WandSighting {
  int64_t time_ns;
  bool lost;  // no marker of it agrees with them
};

// Instants, ascending by time, that the others have placed, and whether this camera agrees.
struct OthersInstant {
  int64_t time_ns;
  bool agrees;
};

std::vector<OthersInstant> InstantsBeside(const RigSolution& solution, int camera) {
  const BundleProblem& problem = solution.built.problem;
  std::vector<OthersInstant> instants;
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    if (!instant.used) continue;
    int others = 0;
    bool agrees = false;
    for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
      const bool fits = std::ranges::any_of(problem.MarkersOf(observation), &BundleMarker::used);
      if (observation.camera == camera) {
        agrees = fits;
      } else {
        others += fits ? 1 : 0;
      }
    }
    if (others >= kMinOthers) instants.push_back({solution.built.instant_time_ns[i], agrees});
  }
  std::ranges::stable_sort(instants, {}, &OthersInstant::time_ns);
  return instants;
}

std::vector<WandSighting> WandSightingsOf(const RigObservations& rig, const RigSolution& solution,
                                          const std::vector<std::vector<int64_t>>& times,
                                          int camera) {
  const std::vector<OthersInstant> instants = InstantsBeside(solution, camera);
  std::vector<WandSighting> sightings;
  if (instants.empty()) return sightings;
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    if (rig.index.camera_of_track[t] != camera) continue;
    const ObservationTable& rows = rig.tracks[t].track.observations;
    for (size_t row = 0; row < rows.size(); ++row) {
      if (!rows.AnyVisible(row)) continue;
      const int64_t time_ns = times[t][row];
      auto next = std::ranges::lower_bound(instants, time_ns, {}, &OthersInstant::time_ns);
      if (next == instants.end() ||
          (next != instants.begin() &&
           time_ns - std::prev(next)->time_ns < next->time_ns - time_ns)) {
        --next;
      }
      const double apart_s = 1e-9 * static_cast<double>(std::abs(next->time_ns - time_ns));
      if (apart_s > kNearPeriods * rig.tracks[t].period_s) continue;
      sightings.push_back({next->time_ns, !next->agrees});
    }
  }
  std::ranges::stable_sort(sightings, {}, &WandSighting::time_ns);
  return sightings;
}

// It was found to have moved, or its clock to have run unevenly.
bool IsExplained(const CauseInput& input, size_t camera) {
  if (std::ranges::count(input.trial.rig_camera, camera) > 1) return true;
  for (size_t t = 0; t < input.rig.tracks.size(); ++t) {
    const int clock = input.rig.index.clock_of_track[t];
    if (input.rig.index.camera_of_track[t] == static_cast<int>(camera) &&
        std::ranges::count(input.trial.uneven_clocks, clock) > 0) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::vector<Cause> FindOutliersInSpan(const CauseInput& input) {
  const RigSolution& solution = input.evaluated.solution;
  const auto times =
      RigTimes(input.rig.tracks, input.rig.index, InitializationFrom(solution).clocks);
  std::vector<Cause> causes;
  for (size_t c = 0; c < input.rig.index.cameras.size(); ++c) {
    if (IsExplained(input, c)) continue;
    const std::vector<WandSighting> sightings =
        WandSightingsOf(input.rig, solution, times, static_cast<int>(c));
    // The span in which lost ones exceed their limit by most.
    double sum = 0, best = 0;
    size_t begin = 0, best_begin = 0, best_end = 0;
    for (size_t i = 0; i < sightings.size(); ++i) {
      if (sum <= 0) {
        sum = 0;
        begin = i;
      }
      sum += (sightings[i].lost ? 1 : 0) - kMinLostShare;
      if (sum <= best) continue;
      best = sum;
      best_begin = begin;
      best_end = i + 1;
    }
    const size_t count = best_end - best_begin;
    size_t lost = 0;
    for (size_t i = best_begin; i < best_end; ++i) lost += sightings[i].lost ? 1 : 0;
    if (lost < kMinLost ||
        static_cast<double>(count) < kMinSpanShare * static_cast<double>(sightings.size())) {
      continue;
    }
    const auto since_s = [&solution](int64_t time_ns) {
      return 1e-9 * static_cast<double>(time_ns - solution.built.instant_time_ns.front());
    };
    const double share = 100 * static_cast<double>(lost) / static_cast<double>(count);
    causes.push_back(
        {{FindingKind::kOutliersInSpan, input.rig.index.cameras[c].camera, share, "%",
          absl::StrFormat("from %.1f s to %.1f s after the first wand view %d of its %d wand views "
                          "agree with no other camera and were left out. If no other finding says "
                          "why, look at what it saw then: another light, a clock that jumped, a "
                          "camera that was touched",
                          since_s(sightings[best_begin].time_ns),
                          since_s(sightings[best_end - 1].time_ns), lost, count)},
         0});
  }
  return causes;
}

}  // namespace rigcal::server
