// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/camera_groups.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "server/associate/instants.h"

namespace rigcal::server {
namespace {

constexpr int kNeededInstants = 40;  // of a pair, to be connected

}  // namespace

CameraGroups GroupCameras(const RigIndex& index, const std::vector<AlignedTrack>& tracks,
                          const std::vector<std::vector<int64_t>>& rig_times) {
  const size_t count = index.cameras.size();
  std::vector<std::vector<int>> common(count, std::vector<int>(count, 0));
  for (const Instant& instant : FindInstants(tracks, rig_times, 0).instants) {
    for (const InstantMember& a : instant.members) {
      for (const InstantMember& b : instant.members) {
        const auto x = static_cast<size_t>(index.camera_of_track[static_cast<size_t>(a.track)]);
        const auto y = static_cast<size_t>(index.camera_of_track[static_cast<size_t>(b.track)]);
        ++common[x][y];
      }
    }
  }
  CameraGroups result;
  result.group_of_camera.resize(count);
  std::iota(result.group_of_camera.begin(), result.group_of_camera.end(), 0);
  const auto join = [&result](int a, int b) {
    for (int& group : result.group_of_camera) {
      if (group == b) group = a;
    }
  };
  for (size_t a = 0; a < count; ++a) {
    for (size_t b = a + 1; b < count; ++b) {
      if (common[a][b] < kNeededInstants) continue;
      join(result.group_of_camera[a], result.group_of_camera[b]);
    }
  }
  std::map<int, int> sizes;
  for (const int group : result.group_of_camera) ++sizes[group];
  result.largest =
      std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; })->first;
  // What would join each further group with the least waving.
  std::vector<int> groups = result.group_of_camera;
  while (true) {
    PairNeed need;
    int from = -1, to = -1;
    for (size_t a = 0; a < count; ++a) {
      for (size_t b = a + 1; b < count; ++b) {
        if (groups[a] == groups[b] || (from >= 0 && common[a][b] <= need.common_count)) continue;
        need = {index.cameras[a].camera, index.cameras[b].camera, common[a][b], kNeededInstants};
        from = groups[b];
        to = groups[a];
      }
    }
    if (from < 0) break;
    std::ranges::replace(groups, from, to);
    result.needs.push_back(std::move(need));
  }
  return result;
}

}  // namespace rigcal::server
