// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/grouped_problem.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>

namespace rigcal::server {
namespace {

constexpr size_t kMaxInformationMarkers = 60'000;

void AppendInstant(const BundleProblem& from, size_t index, BundleProblem* to) {
  BundleInstant instant = from.instants[index];
  instant.first_observation = static_cast<int>(to->observations.size());
  for (BundleObservation observation : from.ObservationsOf(from.instants[index])) {
    const auto markers = from.MarkersOf(observation);
    observation.first_marker = static_cast<int>(to->markers.size());
    to->markers.insert(to->markers.end(), markers.begin(), markers.end());
    to->observations.push_back(observation);
  }
  to->instants.push_back(instant);
}

// The rest of an instant still places the target.
bool StillPlaces(const BundleProblem& problem, const BundleInstant& instant) {
  std::map<int, std::set<int>> cameras_of_marker;
  std::set<int> cameras;
  for (const BundleObservation& observation : problem.ObservationsOf(instant)) {
    for (const BundleMarker& marker : problem.MarkersOf(observation)) {
      if (!marker.used) continue;
      cameras_of_marker[marker.marker].insert(observation.camera);
      cameras.insert(observation.camera);
    }
  }
  const size_t wanted = instant.is_point || problem.IsPoint() ? 1 : instant.is_rigid ? 3 : 2;
  const auto shared = std::ranges::count_if(
      cameras_of_marker, [](const auto& entry) { return entry.second.size() >= 2; });
  return cameras.size() >= 2 && static_cast<size_t>(shared) >= wanted;
}

}  // namespace

GroupedProblem GroupInstants(const RigObservations& rig, const RigSolution& solution) {
  const BundleProblem& all = solution.built.problem;
  GroupedProblem grouped;
  BundleProblem& problem = grouped.problem;
  problem.cameras = all.cameras;
  problem.clocks = all.clocks;
  problem.target = all.target;
  problem.rigid_target = all.rigid_target;
  problem.target.fixed = problem.rigid_target.fixed = true;
  problem.distance = all.distance;
  grouped.stride = (all.markers.size() + kMaxInformationMarkers - 1) / kMaxInformationMarkers;
  grouped.stride = std::max<size_t>(1, grouped.stride);
  grouped.clock_of_camera.assign(all.cameras.size(), -1);
  size_t used = 0;
  int64_t first_ns = 0;
  for (size_t i = 0; i < all.instants.size(); ++i) {
    if (!all.instants[i].used || used++ % grouped.stride != 0) continue;
    const auto track = static_cast<size_t>(solution.instants.instants[i].members.front().track);
    const std::string& session = rig.tracks[track].track.session_id;
    if (grouped.session_ids.empty() || grouped.session_ids.back() != session) {
      grouped.session_ids.push_back(session);
      grouped.is_static.push_back(rig.tracks[track].is_static);
      first_ns = solution.built.instant_time_ns[i];
    }
    grouped.session.push_back(static_cast<int>(grouped.session_ids.size()) - 1);
    grouped.time_s.push_back(1e-9 *
                             static_cast<double>(solution.built.instant_time_ns[i] - first_ns));
    AppendInstant(all, i, &problem);
  }
  grouped.clocks_of_session.resize(grouped.session_ids.size());
  for (size_t t = 0; t < rig.tracks.size(); ++t) {
    const auto found = std::ranges::find(grouped.session_ids, rig.tracks[t].track.session_id);
    if (found == grouped.session_ids.end()) continue;
    const int clock = rig.index.clock_of_track[t];
    int& first = grouped.clock_of_camera[static_cast<size_t>(rig.index.camera_of_track[t])];
    if (first < 0) first = clock;
    std::vector<int>& clocks =
        grouped.clocks_of_session[static_cast<size_t>(found - grouped.session_ids.begin())];
    if (std::ranges::find(clocks, clock) == clocks.end()) clocks.push_back(clock);
  }
  return grouped;
}

BundleProblem Rest(const GroupedProblem& grouped, const std::function<bool(size_t)>& keeps,
                   int left_out) {
  BundleProblem rest = grouped.problem;
  for (size_t i = 0; i < rest.instants.size(); ++i) {
    BundleInstant& instant = rest.instants[i];
    instant.used = instant.used && keeps(i);
    if (!instant.used || left_out < 0) continue;
    bool changed = false;
    for (const BundleObservation& observation : rest.ObservationsOf(instant)) {
      if (observation.camera != left_out) continue;
      for (int m = 0; m < observation.marker_count; ++m) {
        rest.markers[static_cast<size_t>(observation.first_marker + m)].used = false;
        changed = true;
      }
    }
    if (changed) instant.used = StillPlaces(rest, instant);
  }
  return rest;
}

}  // namespace rigcal::server
