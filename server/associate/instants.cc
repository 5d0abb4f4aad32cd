// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>
#include <utility>

#include "server/associate/view_groups.h"

namespace rigcal::server {
namespace {

constexpr double kPeriodShare = 0.25;
// Of cameras that have rows between those of slower ones. Their intervals need not be even: at
// 200 Hz a wand that blinks at 500 Hz is emitted after 4 and 6 ms alternately, of which the median
// may be either, and two cameras may emit neighbouring blinks, 2 ms apart.
constexpr double kPeriodShareBetween = 0.65;
// Cameras run freely when instants a whole period wide have so many more cameras each.
constexpr double kFreeRunningGain = 1.25;
// Or when a camera has so many more instants.
constexpr uint32_t kStarvedTrackGain = 2;
// A camera of so much shorter a period than the slowest has rows between theirs.
constexpr double kFastShare = 0.6;
// Reach of an instant of the slow cameras for rows of such a camera, in its own periods: its
// intervals need not be even.
constexpr double kReachPeriods = 0.75;
// For cameras with one row each, which have no period.
constexpr double kToleranceWithoutPeriodS = 0.005;

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

// Makes an instant of a group; with one camera only it is nobody's instant.
void Close(const ViewGroup& group, InstantList* list) {
  if (group.size() < 2) {
    ++list->alone_count[static_cast<size_t>(group.front().track)];
    return;
  }
  Instant instant;
  instant.rig_time_ns = MeanTimeNs(group);
  for (const WandView& view : group) {
    instant.members.push_back({view.track, view.observation});
    ++list->instant_count[static_cast<size_t>(view.track)];
  }
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

InstantList ListOf(size_t tracks, const ViewGrouping& grouping) {
  InstantList list = EmptyList(tracks);
  for (const ViewGroup& group : grouping.groups) Close(group, &list);
  for (const WandView& view : grouping.skipped)
    ++list.skipped_count[static_cast<size_t>(view.track)];
  return list;
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

struct AlikeGrouping {
  ViewGrouping views;
  bool run_freely = false;
};

// Cameras of about one rate.
AlikeGrouping GroupAlike(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members,
                         const std::vector<WandView>& views, const InstantOptions& options,
                         double period_share) {
  const Periods periods = PeriodsOf(tracks, members);
  double tolerance_s = options.tolerance_s;
  if (tolerance_s <= 0) {
    tolerance_s =
        periods.shortest_s > 0 ? period_share * periods.shortest_s : kToleranceWithoutPeriodS;
  }
  ViewGrouping together = GroupTogether(tracks, views, Nanoseconds(tolerance_s));
  if (options.tolerance_s > 0 || periods.longest_s <= 0) return {std::move(together), false};
  ViewGrouping nearest = GroupNearest(tracks, views, Nanoseconds(periods.longest_s));
  const InstantList if_together = ListOf(tracks.size(), together);
  const InstantList if_nearest = ListOf(tracks.size(), nearest);
  const bool run_freely =
      CamerasPerInstant(if_nearest) > kFreeRunningGain * CamerasPerInstant(if_together) ||
      StarvesTrack(if_together, if_nearest);
  return {run_freely ? std::move(nearest) : std::move(together), run_freely};
}

// Tracks with rows between those of the slowest.
std::vector<int> FastTracks(const std::vector<AlignedTrack>& tracks,
                            const std::vector<int>& members) {
  const double longest_s = PeriodsOf(tracks, members).longest_s;
  std::vector<int> fast;
  for (const int track : members) {
    const double own_s = tracks[static_cast<size_t>(track)].period_s;
    if (own_s > 0 && own_s < kFastShare * longest_s) fast.push_back(track);
  }
  return fast;
}

std::vector<WandView> ViewsOf(const std::vector<WandView>& views, const std::vector<int>& members) {
  std::vector<WandView> own;
  for (const WandView& view : views) {
    if (std::find(members.begin(), members.end(), view.track) != members.end()) own.push_back(view);
  }
  return own;
}

// True if one of these times, ascending, lies within `reach_ns`.
bool IsNear(const std::vector<int64_t>& times_ns, int64_t time_ns, int64_t reach_ns) {
  const auto after = std::lower_bound(times_ns.begin(), times_ns.end(), time_ns - reach_ns);
  return after != times_ns.end() && *after <= time_ns + reach_ns;
}

// Several rates: first the slowest cameras, whose instants the fast ones join; what these saw in
// between makes instants among themselves. Slow cameras that run freely share no instants; then
// each instant is as wide as their period and holds one view of every camera.
ViewGrouping GroupByRates(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members,
                          const std::vector<WandView>& views, const InstantOptions& options,
                          double period_share) {
  const std::vector<int> fast =
      options.tolerance_s > 0 ? std::vector<int>() : FastTracks(tracks, members);
  if (fast.empty()) return GroupAlike(tracks, members, views, options, period_share).views;
  std::vector<int> slow;
  std::set_difference(members.begin(), members.end(), fast.begin(), fast.end(),
                      std::back_inserter(slow));
  AlikeGrouping of_slow = GroupAlike(tracks, slow, ViewsOf(views, slow), options, period_share);
  if (of_slow.run_freely) return GroupAlike(tracks, members, views, options, period_share).views;
  ViewGrouping grouping = std::move(of_slow.views);
  std::vector<int64_t> slow_times_ns;
  for (const ViewGroup& group : grouping.groups) slow_times_ns.push_back(MeanTimeNs(group));
  std::vector<WandView> between;
  for (const int track : fast) {
    const double period_s = tracks[static_cast<size_t>(track)].period_s;
    const std::vector<WandView> rest =
        JoinNearest(tracks, ViewsOf(views, {track}), slow_times_ns,
                    Nanoseconds(kReachPeriods * period_s), &grouping.groups);
    between.insert(between.end(), rest.begin(), rest.end());
  }
  std::sort(slow_times_ns.begin(), slow_times_ns.end());
  for (ViewGroup& group : grouping.groups) std::sort(group.begin(), group.end(), Earlier);
  std::sort(between.begin(), between.end(), Earlier);
  ViewGrouping others = GroupByRates(tracks, fast, between, options, kPeriodShareBetween);
  const int64_t slow_period_ns = Nanoseconds(PeriodsOf(tracks, slow).longest_s);
  for (ViewGroup& group : others.groups) {
    const bool between_rows =
        group.size() == 1 && IsNear(slow_times_ns, group.front().time_ns, slow_period_ns);
    if (between_rows) {
      grouping.skipped.push_back(group.front());
    } else {
      grouping.groups.push_back(std::move(group));
    }
  }
  grouping.skipped.insert(grouping.skipped.end(), others.skipped.begin(), others.skipped.end());
  return grouping;
}

InstantList FindInSession(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members,
                          const std::vector<WandView>& views, const InstantOptions& options) {
  InstantList list =
      ListOf(tracks.size(), GroupByRates(tracks, members, views, options, kPeriodShare));
  std::stable_sort(
      list.instants.begin(), list.instants.end(),
      [](const Instant& a, const Instant& b) { return a.rig_time_ns < b.rig_time_ns; });
  return list;
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
    std::vector<WandView> views;
    for (const int t : members) {
      const std::vector<Observation>& rows = tracks[static_cast<size_t>(t)].track.observations;
      for (size_t i = 0; i < rows.size(); ++i) {
        if (rows[i].VisibleCount() == 0) continue;
        views.push_back({rig_time_ns[static_cast<size_t>(t)][i], t, static_cast<int>(i)});
      }
    }
    std::sort(views.begin(), views.end(), Earlier);
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
