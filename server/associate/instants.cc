// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>

namespace rigcal::server {
namespace {

constexpr double kPeriodShare = 0.25;
// For cameras with one row each, which have no period.
constexpr double kToleranceWithoutPeriodS = 0.005;

struct View {
  int64_t time_ns;
  int track;
  int observation;
};

int64_t ToleranceNs(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members,
                    const InstantOptions& options) {
  double tolerance_s = options.tolerance_s;
  if (tolerance_s <= 0) {
    double period_s = std::numeric_limits<double>::infinity();
    for (const int track : members) {
      const double own = tracks[static_cast<size_t>(track)].period_s;
      if (own > 0) period_s = std::min(period_s, own);
    }
    tolerance_s = std::isfinite(period_s) ? kPeriodShare * period_s : kToleranceWithoutPeriodS;
  }
  return std::llround(tolerance_s * 1e9);
}

// Closes the group [begin, end) of one moment; with one camera only it is nobody's instant.
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

}  // namespace

InstantList FindInstants(const std::vector<AlignedTrack>& tracks,
                         const std::vector<std::vector<int64_t>>& rig_time_ns,
                         const InstantOptions& options) {
  InstantList list;
  list.alone_count.assign(tracks.size(), 0);
  list.instant_count.assign(tracks.size(), 0);
  list.shared_count.assign(tracks.size(), std::vector<int>(tracks.size(), 0));
  std::map<std::string, std::vector<int>> sessions;
  for (size_t t = 0; t < tracks.size(); ++t) {
    sessions[tracks[t].track.session_id].push_back(static_cast<int>(t));
  }
  for (const auto& [session_id, members] : sessions) {
    const int64_t tolerance_ns = ToleranceNs(tracks, members, options);
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
    for (size_t begin = 0; begin < views.size();) {
      size_t end = begin + 1;
      std::vector<const std::string*> cameras = {
          &tracks[static_cast<size_t>(views[begin].track)].track.camera.camera};
      for (; end < views.size() && views[end].time_ns - views[begin].time_ns <= tolerance_ns;
           ++end) {
        const std::string& camera =
            tracks[static_cast<size_t>(views[end].track)].track.camera.camera;
        if (std::any_of(cameras.begin(), cameras.end(),
                        [&camera](const std::string* name) { return *name == camera; })) {
          break;
        }
        cameras.push_back(&camera);
      }
      Close(views, begin, end, &list);
      begin = end;
    }
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
