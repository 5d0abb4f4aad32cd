// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/joined_cameras.h"

#include <algorithm>
#include <map>
#include <numeric>

namespace rigcal::server {

JoinedCameras JoinCameras(const BundleProblem& problem) {
  const size_t count = problem.cameras.size();
  std::vector<size_t> parent(count);
  std::iota(parent.begin(), parent.end(), size_t{0});
  const auto root = [&parent](size_t c) {
    while (parent[c] != c) c = parent[c];
    return c;
  };
  JoinedCameras joined{std::vector<bool>(count, false),
                       std::vector<bool>(problem.clocks.size(), false)};
  std::vector<bool> seen(count, false);
  for (const BundleInstant& instant : problem.instants) {
    int first = -1;
    ForEachUsedMarker(problem, instant,
                      [&](const BundleObservation& observation, const BundleMarker&) {
                        const auto camera = static_cast<size_t>(observation.camera);
                        seen[camera] = true;
                        joined.clock[static_cast<size_t>(observation.clock)] = true;
                        if (first < 0) first = observation.camera;
                        parent[root(camera)] = root(static_cast<size_t>(first));
                      });
  }
  std::map<size_t, int> sizes;
  for (size_t c = 0; c < count; ++c) sizes[root(c)] += seen[c] ? 1 : 0;
  const auto largest =
      std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; });
  for (size_t c = 0; c < count; ++c) {
    joined.camera[c] = seen[c] && root(c) == largest->first;
  }
  return joined;
}

void FixWhatIsSeen(const GroupedProblem& grouped, const JoinedCameras& joined,
                   BundleProblem* problem) {
  const auto fixed = std::ranges::count(problem->cameras, true, &BundleCamera::pose_fixed);
  if (fixed == 1) {
    const auto first = std::ranges::find(joined.camera, true) - joined.camera.begin();
    const auto own = std::ranges::find(problem->cameras, true, &BundleCamera::pose_fixed);
    if (!joined.camera[static_cast<size_t>(own - problem->cameras.begin())] &&
        first < static_cast<std::ptrdiff_t>(joined.camera.size())) {
      own->pose_fixed = false;
      problem->cameras[static_cast<size_t>(first)].pose_fixed = true;
    }
  }
  for (const std::vector<int>& clocks : grouped.clocks_of_session) {
    int seen = -1;
    bool has_fixed = false, any_free = false;
    for (const int k : clocks) {
      const BundleClock& clock = problem->clocks[static_cast<size_t>(k)];
      any_free |= !clock.offset_fixed;
      if (!joined.clock[static_cast<size_t>(k)]) continue;
      if (seen < 0) seen = k;
      has_fixed |= clock.offset_fixed;
    }
    if (any_free && seen >= 0 && !has_fixed) {
      problem->clocks[static_cast<size_t>(seen)].offset_fixed = true;
      problem->clocks[static_cast<size_t>(seen)].rate_fixed = true;
    }
  }
}

}  // namespace rigcal::server
