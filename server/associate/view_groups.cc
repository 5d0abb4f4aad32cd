// SPDX-License-Identifier: Apache-2.0
#include "server/associate/view_groups.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <string>
#include <tuple>

namespace rigcal::server {
namespace {

const std::string& CameraOf(const std::vector<AlignedTrack>& tracks, const WandView& view) {
  return tracks[static_cast<size_t>(view.track)].track.camera.camera;
}

bool Has(const std::vector<AlignedTrack>& tracks, const ViewGroup& group,
         const std::string& camera) {
  return std::ranges::any_of(
      group, [&](const WandView& view) { return CameraOf(tracks, view) == camera; });
}

}  // namespace

bool Earlier(const WandView& a, const WandView& b) {
  return std::tie(a.time_ns, a.track, a.observation) < std::tie(b.time_ns, b.track, b.observation);
}

int64_t MeanTimeNs(const ViewGroup& group) {
  int64_t sum = 0;
  for (const WandView& view : group) sum += view.time_ns - group.front().time_ns;
  return group.front().time_ns + sum / static_cast<int64_t>(group.size());
}

ViewGrouping GroupTogether(const std::vector<AlignedTrack>& tracks,
                           const std::vector<WandView>& views, int64_t tolerance_ns) {
  ViewGrouping grouping;
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    ViewGroup& group = grouping.groups.emplace_back(1, views[begin]);
    for (; end < views.size() && views[end].time_ns - views[begin].time_ns <= tolerance_ns; ++end) {
      if (Has(tracks, group, CameraOf(tracks, views[end]))) break;
      group.push_back(views[end]);
    }
    begin = end;
  }
  return grouping;
}

ViewGrouping GroupNearest(const std::vector<AlignedTrack>& tracks,
                          const std::vector<WandView>& views, int64_t window_ns) {
  ViewGrouping grouping;
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    while (end < views.size() && views[end].time_ns - views[begin].time_ns < window_ns) ++end;
    const int64_t middle_ns = views[begin].time_ns + window_ns / 2;
    std::map<std::string, WandView> nearest;
    for (size_t i = begin; i < end; ++i) {
      const auto [entry, inserted] = nearest.try_emplace(CameraOf(tracks, views[i]), views[i]);
      if (inserted) continue;
      WandView& other = entry->second;
      const bool nearer =
          std::abs(views[i].time_ns - middle_ns) < std::abs(other.time_ns - middle_ns);
      grouping.skipped.push_back(nearer ? other : views[i]);
      if (nearer) other = views[i];
    }
    ViewGroup& group = grouping.groups.emplace_back();
    for (const auto& [camera, view] : nearest) group.push_back(view);
    std::sort(group.begin(), group.end(), Earlier);
    begin = end;
  }
  return grouping;
}

std::vector<WandView> JoinNearest(const std::vector<AlignedTrack>& tracks,
                                  const std::vector<WandView>& of_track,
                                  const std::vector<int64_t>& times_ns, int64_t reach_ns,
                                  std::vector<ViewGroup>* groups) {
  if (of_track.empty()) return {};
  const std::string& camera = CameraOf(tracks, of_track.front());
  std::vector<bool> joined(of_track.size(), false);
  for (size_t g = 0; g < groups->size(); ++g) {
    ViewGroup& group = (*groups)[g];
    if (Has(tracks, group, camera)) continue;
    const auto after = std::ranges::lower_bound(of_track, times_ns[g], {}, &WandView::time_ns);
    const auto at = static_cast<size_t>(after - of_track.begin());
    size_t best = of_track.size();
    int64_t least_ns = reach_ns + 1;
    for (size_t i = at > 0 ? at - 1 : 0; i <= at && i < of_track.size(); ++i) {
      const int64_t away_ns = std::abs(of_track[i].time_ns - times_ns[g]);
      if (!joined[i] && away_ns < least_ns) least_ns = away_ns, best = i;
    }
    if (best == of_track.size()) continue;
    joined[best] = true;
    group.push_back(of_track[best]);
  }
  std::vector<WandView> rest;
  for (size_t i = 0; i < of_track.size(); ++i) {
    if (!joined[i]) rest.push_back(of_track[i]);
  }
  return rest;
}

}  // namespace rigcal::server
