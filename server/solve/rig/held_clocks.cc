// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/held_clocks.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {
namespace {

constexpr size_t kManyClocks = 8;  // of one session

}  // namespace

bool HasManyClocks(const std::vector<ClockCorrection>& clocks) {
  return std::ranges::any_of(ClocksBySession(clocks), [](const auto& session) {
    return session.second.size() >= kManyClocks;
  });
}

HeldClocks::HeldClocks(const std::vector<AlignedTrack>& tracks, const RigIndex& index,
                       const std::vector<ClockCorrection>& clocks, int reference_camera)
    : clocks_(ClocksBySession(clocks)) {
  for (const ClockCorrection& clock : clocks) session_of_clock_.push_back(clock.session_id);
  for (const bool any_camera : {false, true}) {
    for (size_t t = 0; t < tracks.size(); ++t) {
      if (!any_camera && index.camera_of_track[t] != reference_camera) continue;
      reference_.try_emplace(tracks[t].track.session_id, index.clock_of_track[t]);
    }
  }
}

bool HeldClocks::IsReference(size_t clock) const {
  return reference_.at(session_of_clock_[clock]) == static_cast<int>(clock);
}

bool HeldClocks::IsHeld(size_t clock) const {
  const BySession& held = held_.empty() ? reference_ : held_;
  return held.at(session_of_clock_[clock]) == static_cast<int>(clock);
}

bool HeldClocks::Choose(const BundleProblem& problem, bool others) {
  const BySession before = std::exchange(held_, {});
  if (others) held_ = reference_;
  for (auto& [session, held] : held_) {
    std::vector<std::pair<double, int>> moved_s;
    for (const size_t k : clocks_.at(session)) {
      const int clock = static_cast<int>(k);
      if (clock != held) moved_s.emplace_back(problem.clocks[k].time_offset_s, clock);
    }
    std::ranges::sort(moved_s);
    if (moved_s.size() + 1 >= kManyClocks) held = moved_s[moved_s.size() / 2].second;
  }
  return held_ != before;
}

void HeldClocks::LetFollow(BundleProblem* problem) const {
  for (const auto& [session, held] : held_) {
    if (held == reference_.at(session)) continue;
    std::vector<double> moved_s;
    for (const size_t k : clocks_.at(session)) {
      if (static_cast<int>(k) != held) moved_s.push_back(problem->clocks[k].time_offset_s);
    }
    const double all_s = Median(moved_s);
    for (const size_t k : clocks_.at(session)) {
      if (static_cast<int>(k) != held) problem->clocks[k].time_offset_s -= all_s;
    }
  }
}

void HeldClocks::KeepReferences(const std::vector<ClockCorrection>& before,
                                std::vector<ClockCorrection>* clocks) const {
  for (const auto& [session, reference] : reference_) {
    const auto r = static_cast<size_t>(reference);
    const double moved_s = (*clocks)[r].time_offset_s - before[r].time_offset_s;
    for (ClockCorrection& clock : *clocks) {
      if (clock.session_id == session) clock.time_offset_s -= moved_s;
    }
    (*clocks)[r].time_offset_s = before[r].time_offset_s;
  }
}

ClockMovement FindClockMovement(const BundleProblem& problem) {
  struct OfClock {
    double span_s = 0, speed2 = 0;
    double rows_s = 0;  // furthest from the time of the middle row
    int markers = 0;
  };
  std::vector<OfClock> clocks(problem.clocks.size());
  for (const BundleObservation& observation : problem.observations) {
    OfClock& own = clocks[static_cast<size_t>(observation.clock)];
    own.span_s = std::max(own.span_s, std::abs(observation.clock_time_s));
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      const BundleCamera& camera = problem.CameraOf(observation);
      own.rows_s = std::max(
          own.rows_s, std::abs(camera.line_delay_s * (marker.centre_px.y() - camera.middle_row)));
      own.speed2 += marker.velocity_px_s.squaredNorm();
      ++own.markers;
    }
  }
  ClockMovement most;
  for (size_t k = 0; k < clocks.size(); ++k) {
    const BundleClock& clock = problem.clocks[k];
    const double moved_s = std::abs(clock.time_offset_s) +
                           std::abs(clock.time_rate) * clocks[k].span_s + clocks[k].rows_s;
    most.s = std::max(most.s, moved_s);
    most.px =
        std::max(most.px, moved_s * std::sqrt(clocks[k].speed2 / std::max(1, clocks[k].markers)));
  }
  return most;
}

}  // namespace rigcal::server
