// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <string>
#include <tuple>
#include <utility>

namespace rigcal::server {
namespace {

constexpr double kPeriodShare = 0.25;
// Cameras run freely when instants a whole period wide have so many more cameras each.
constexpr double kFreeRunningGain = 1.25;
// Or when a camera has so many more instants.
constexpr uint32_t kStarvedTrackGain = 2;
// For cameras with one row each, which have no period.
constexpr double kToleranceWithoutPeriodS = 0.005;

struct View {
  int64_t time_ns;
  int track;
  int observation;
};

const std::string* CameraOf(const std::vector<AlignedTrack>& tracks, const View& view) {
  return &tracks[static_cast<size_t>(view.track)].track.camera.camera;
}

// Median periods of the slowest and the fastest of these tracks; 0 where none has one.
struct Periods {
  double shortest_s = 0, longest_s = 0;
};

Periods PeriodsOf(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members) {
  Periods periods;
  for (const int track : members) {
    const double own_s = tracks[static_cast<size_t>(track)].period_s;
    if (own_s <= 0) continue;
    if (periods.shortest_s == 0 || own_s < periods.shortest_s) periods.shortest_s = own_s;
    periods.longest_s = std::max(periods.longest_s, own_s);
  }
  return periods;
}

int64_t Nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

// Makes an instant of the group [begin, end); with one camera only it is nobody's instant.
void Close(const std::vector<View>& views, size_t begin, size_t end, InstantList* list) {
  if (end - begin < 2) {
    ++list->alone_count[static_cast<size_t>(views[begin].track)];
    return;
  }
  Instant instant;
  int64_t sum = 0;
  for (size_t i = begin; i < end; ++i) {
    sum += views[i].time_ns - views[begin].time_ns;
    instant.members.push_back({views[i].track, views[i].observation});
    ++list->instant_count[static_cast<size_t>(views[i].track)];
  }
  instant.rig_time_ns = views[begin].time_ns + sum / static_cast<int64_t>(end - begin);
  std::sort(instant.members.begin(), instant.members.end(),
            [](const InstantMember& a, const InstantMember& b) { return a.track < b.track; });
  for (const InstantMember& a : instant.members) {
    for (const InstantMember& b : instant.members) {
      if (a.track != b.track) {
        ++list->shared_count[static_cast<size_t>(a.track)][static_cast<size_t>(b.track)];
      }
    }
  }
  list->instants.push_back(std::move(instant));
}

// Cameras that run together: a group ends at the tolerance, or where a camera comes again.
void GroupTogether(const std::vector<AlignedTrack>& tracks, const std::vector<View>& views,
                   int64_t tolerance_ns, InstantList* list) {
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    std::vector<const std::string*> cameras = {CameraOf(tracks, views[begin])};
    for (; end < views.size() && views[end].time_ns - views[begin].time_ns <= tolerance_ns; ++end) {
      const std::string* camera = CameraOf(tracks, views[end]);
      if (std::any_of(cameras.begin(), cameras.end(),
                      [camera](const std::string* name) { return *name == *camera; })) {
        break;
      }
      cameras.push_back(camera);
    }
    Close(views, begin, end, list);
    begin = end;
  }
}

// Cameras that run freely: of each camera the view nearest the middle of the group's time.
void GroupNearest(const std::vector<AlignedTrack>& tracks, const std::vector<View>& views,
                  int64_t window_ns, InstantList* list) {
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    while (end < views.size() && views[end].time_ns - views[begin].time_ns < window_ns) ++end;
    const int64_t middle_ns = views[begin].time_ns + window_ns / 2;
    std::map<std::string, View> nearest;
    for (size_t i = begin; i < end; ++i) {
      const auto [entry, inserted] = nearest.try_emplace(*CameraOf(tracks, views[i]), views[i]);
      if (inserted) continue;
      const View& other = entry->second;
      const bool nearer =
          std::abs(views[i].time_ns - middle_ns) < std::abs(other.time_ns - middle_ns);
      ++list->skipped_count[static_cast<size_t>(nearer ? other.track : views[i].track)];
      if (nearer) entry->second = views[i];
    }
    std::vector<View> group;
    for (const auto& [camera, view] : nearest) group.push_back(view);
    Close(group, 0, group.size(), list);
    begin = end;
  }
}

InstantList EmptyList(size_t tracks) {
  InstantList list;
  list.alone_count.assign(tracks, 0);
  list.instant_count.assign(tracks, 0);
  list.skipped_count.assign(tracks, 0);
  list.shared_count.assign(tracks, std::vector<int>(tracks, 0));
  return list;
}

size_t MemberCount(const InstantList& list) {
  size_t count = 0;
  for (const Instant& instant : list.instants) count += instant.members.size();
  return count;
}

void Append(InstantList from, InstantList* to) {
  for (size_t t = 0; t < from.alone_count.size(); ++t) {
    to->alone_count[t] += from.alone_count[t];
    to->instant_count[t] += from.instant_count[t];
    to->skipped_count[t] += from.skipped_count[t];
    for (size_t u = 0; u < from.alone_count.size(); ++u) {
      to->shared_count[t][u] += from.shared_count[t][u];
    }
  }
  std::move(from.instants.begin(), from.instants.end(), std::back_inserter(to->instants));
}

// Mean number of cameras per instant.
double CamerasPerInstant(const InstantList& list) {
  return list.instants.empty()
             ? 0
             : static_cast<double>(MemberCount(list)) / static_cast<double>(list.instants.size());
}

// A camera that runs at the others' rate, but some constant time beside them, has no part in
// instants that are narrower than that; among many cameras the mean hardly shows it.
bool StarvesTrack(const InstantList& together, const InstantList& nearest) {
  for (size_t t = 0; t < together.instant_count.size(); ++t) {
    if (nearest.instant_count[t] > kStarvedTrackGain * together.instant_count[t] &&
        together.alone_count[t] > together.instant_count[t]) {
      return true;
    }
  }
  return false;
}

InstantList FindInSession(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members,
                          const std::vector<View>& views, const InstantOptions& options) {
  const Periods periods = PeriodsOf(tracks, members);
  double tolerance_s = options.tolerance_s;
  if (tolerance_s <= 0) {
    tolerance_s =
        periods.shortest_s > 0 ? kPeriodShare * periods.shortest_s : kToleranceWithoutPeriodS;
  }
  InstantList together = EmptyList(tracks.size());
  GroupTogether(tracks, views, Nanoseconds(tolerance_s), &together);
  if (options.tolerance_s > 0 || periods.longest_s <= 0) return together;
  InstantList nearest = EmptyList(tracks.size());
  GroupNearest(tracks, views, Nanoseconds(periods.longest_s), &nearest);
  const bool run_freely =
      CamerasPerInstant(nearest) > kFreeRunningGain * CamerasPerInstant(together) ||
      StarvesTrack(together, nearest);
  return run_freely ? nearest : together;
}

}  // namespace

InstantList FindInstants(const std::vector<AlignedTrack>& tracks,
                         const std::vector<std::vector<int64_t>>& rig_time_ns,
                         const InstantOptions& options) {
  InstantList list = EmptyList(tracks.size());
  std::map<std::string, std::vector<int>> sessions;
  for (size_t t = 0; t < tracks.size(); ++t) {
    sessions[tracks[t].track.session_id].push_back(static_cast<int>(t));
  }
  for (const auto& [session_id, members] : sessions) {
    std::vector<View> views;
    for (const int t : members) {
      const std::vector<Observation>& rows = tracks[static_cast<size_t>(t)].track.observations;
      for (size_t i = 0; i < rows.size(); ++i) {
        if (rows[i].VisibleCount() == 0) continue;
        views.push_back({rig_time_ns[static_cast<size_t>(t)][i], t, static_cast<int>(i)});
      }
    }
    std::sort(views.begin(), views.end(), [](const View& a, const View& b) {
      return std::tie(a.time_ns, a.track, a.observation) <
             std::tie(b.time_ns, b.track, b.observation);
    });
    Append(FindInSession(tracks, members, views, options), &list);
  }
  return list;
}

std::vector<std::vector<int64_t>> CoarseRigTimes(const std::vector<AlignedTrack>& tracks) {
  std::vector<std::vector<int64_t>> times(tracks.size());
  for (size_t t = 0; t < tracks.size(); ++t) {
    times[t].reserve(tracks[t].track.observations.size());
    for (const Observation& observation : tracks[t].track.observations) {
      times[t].push_back(tracks[t].CoarseRigTimeNs(observation));
    }
  }
  return times;
}

}  // namespace rigcal::server
