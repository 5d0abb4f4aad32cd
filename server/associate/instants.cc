// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>

#include "absl/numeric/int128.h"

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

// A row in which a camera sees the wand, at its rig time.
struct WandView {
  int64_t time_ns = 0;
  int track = 0;        // index into the aligned tracks
  int observation = 0;  // index into that track's observations
};

// Views of one instant, at least one, one per camera, ascending.
using ViewGroup = std::vector<WandView>;

struct ViewGrouping {
  std::vector<ViewGroup> groups;
  std::vector<WandView> skipped;  // there is a nearer one of the same camera
};

const std::string& CameraOf(const std::vector<AlignedTrack>& tracks, const WandView& view) {
  return tracks[static_cast<size_t>(view.track)].track.camera.camera;
}

bool Has(const std::vector<AlignedTrack>& tracks, const ViewGroup& group,
         const std::string& camera) {
  return std::ranges::any_of(
      group, [&](const WandView& view) { return CameraOf(tracks, view) == camera; });
}

// By time, then track and row.
bool Earlier(const WandView& a, const WandView& b) {
  return std::tie(a.time_ns, a.track, a.observation) < std::tie(b.time_ns, b.track, b.observation);
}

int64_t MeanTimeNs(const ViewGroup& group) {
  // Of many views of slow cameras it may have more than 64 bits.
  absl::int128 sum = 0;
  for (const WandView& view : group) sum += view.time_ns - group.front().time_ns;
  return group.front().time_ns + static_cast<int64_t>(sum / static_cast<int64_t>(group.size()));
}

// Cameras that run together: a group ends `tolerance_ns` after its first view, or where a camera
// comes again. `views` ascend here and below.
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

// Cameras that run freely: of each camera the view nearest the middle of a window of time.
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

// Gives each group without a view of the same camera the one of these views of one track that is
// nearest its time (`times_ns`, by group) and up to `reach_ns` away; a view goes to one group at
// most. Returns the others.
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

// Median periods of the slowest and the fastest of these tracks; 0 where none has one.
struct Periods {
  double shortest_s = 0, longest_s = 0;
};

Periods PeriodsOf(const std::vector<AlignedTrack>& tracks, const std::vector<int>& members) {
  Periods periods;
  for (const int track : members) {
    const double own_s = tracks[static_cast<size_t>(track)].FramePeriodS();
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
  instant.members.reserve(group.size());
  for (const WandView& view : group) {
    instant.members.push_back({view.track, view.observation});
    ++list->instant_count[static_cast<size_t>(view.track)];
  }
  std::ranges::sort(instant.members, {}, &InstantMember::track);
  list->instants.push_back(std::move(instant));
}

void Add(const ViewGrouping& grouping, InstantList* list) {
  for (const ViewGroup& group : grouping.groups) Close(group, list);
  for (const WandView& view : grouping.skipped) {
    ++list->skipped_count[static_cast<size_t>(view.track)];
  }
}

// Mean number of cameras per instant.
double CamerasPerInstant(const InstantList& list) {
  const double members = std::accumulate(list.instant_count.begin(), list.instant_count.end(), 0.0);
  return list.instants.empty() ? 0 : members / static_cast<double>(list.instants.size());
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
                         const std::vector<WandView>& views, double tolerance_s,
                         double period_share) {
  const Periods periods = PeriodsOf(tracks, members);
  const double width_s = tolerance_s > 0          ? tolerance_s
                         : periods.shortest_s > 0 ? period_share * periods.shortest_s
                                                  : kToleranceWithoutPeriodS;
  ViewGrouping together = GroupTogether(tracks, views, Nanoseconds(width_s));
  if (tolerance_s > 0 || periods.longest_s <= 0) return {std::move(together), false};
  ViewGrouping nearest = GroupNearest(tracks, views, Nanoseconds(periods.longest_s));
  InstantList if_together(tracks.size()), if_nearest(tracks.size());
  Add(together, &if_together);
  Add(nearest, &if_nearest);
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
    const double own_s = tracks[static_cast<size_t>(track)].FramePeriodS();
    if (own_s > 0 && own_s < kFastShare * longest_s) fast.push_back(track);
  }
  return fast;
}

std::vector<WandView> ViewsOf(const std::vector<WandView>& views, const std::vector<int>& members) {
  std::vector<WandView> own;
  std::ranges::copy_if(views, std::back_inserter(own), [&members](const WandView& view) {
    return std::ranges::find(members, view.track) != members.end();
  });
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
                          const std::vector<WandView>& views, double tolerance_s,
                          double period_share) {
  const std::vector<int> fast = tolerance_s > 0 ? std::vector<int>() : FastTracks(tracks, members);
  if (fast.empty()) return GroupAlike(tracks, members, views, tolerance_s, period_share).views;
  std::vector<int> slow;
  std::set_difference(members.begin(), members.end(), fast.begin(), fast.end(),
                      std::back_inserter(slow));
  AlikeGrouping of_slow = GroupAlike(tracks, slow, ViewsOf(views, slow), tolerance_s, period_share);
  if (of_slow.run_freely)
    return GroupAlike(tracks, members, views, tolerance_s, period_share).views;
  ViewGrouping grouping = std::move(of_slow.views);
  std::vector<int64_t> slow_times_ns;
  for (const ViewGroup& group : grouping.groups) slow_times_ns.push_back(MeanTimeNs(group));
  std::vector<WandView> between;
  for (const int track : fast) {
    const double period_s = tracks[static_cast<size_t>(track)].FramePeriodS();
    const std::vector<WandView> rest =
        JoinNearest(tracks, ViewsOf(views, {track}), slow_times_ns,
                    Nanoseconds(kReachPeriods * period_s), &grouping.groups);
    between.insert(between.end(), rest.begin(), rest.end());
  }
  std::ranges::sort(slow_times_ns);
  for (ViewGroup& group : grouping.groups) std::sort(group.begin(), group.end(), Earlier);
  std::sort(between.begin(), between.end(), Earlier);
  ViewGrouping others = GroupByRates(tracks, fast, between, tolerance_s, kPeriodShareBetween);
  const int64_t slow_period_ns = Nanoseconds(PeriodsOf(tracks, slow).longest_s);
  for (ViewGroup& group : others.groups) {
    const bool between_rows =
        group.size() == 1 && IsNear(slow_times_ns, group.front().time_ns, slow_period_ns);
    if (between_rows) grouping.skipped.push_back(group.front());
    if (!between_rows) grouping.groups.push_back(std::move(group));
  }
  grouping.skipped.insert(grouping.skipped.end(), others.skipped.begin(), others.skipped.end());
  return grouping;
}

}  // namespace

InstantList FindInstants(const std::vector<AlignedTrack>& tracks,
                         const std::vector<std::vector<int64_t>>& rig_time_ns, double tolerance_s) {
  InstantList list(tracks.size());
  std::map<std::string, std::vector<int>> sessions;
  for (size_t t = 0; t < tracks.size(); ++t) {
    sessions[tracks[t].track.session_id].push_back(static_cast<int>(t));
  }
  for (const auto& [session_id, members] : sessions) {
    std::vector<WandView> views;
    size_t row_count = 0;
    for (const int t : members) {
      row_count += tracks[static_cast<size_t>(t)].track.observations.size();
    }
    views.reserve(row_count);
    for (const int t : members) {
      const ObservationTable& rows = tracks[static_cast<size_t>(t)].track.observations;
      for (size_t i = 0; i < rows.size(); ++i) {
        if (!rows.AnyVisible(i)) continue;
        views.push_back({rig_time_ns[static_cast<size_t>(t)][i], t, static_cast<int>(i)});
      }
    }
    std::sort(views.begin(), views.end(), Earlier);
    const auto before = static_cast<std::ptrdiff_t>(list.instants.size());
    Add(GroupByRates(tracks, members, views, tolerance_s, kPeriodShare), &list);
    std::ranges::stable_sort(list.instants.begin() + before, list.instants.end(), {},
                             &Instant::rig_time_ns);
  }
  return list;
}

std::vector<std::vector<int64_t>> CoarseRigTimes(const std::vector<AlignedTrack>& tracks) {
  std::vector<std::vector<int64_t>> times(tracks.size());
  for (size_t t = 0; t < tracks.size(); ++t) {
    const ObservationTable& rows = tracks[t].track.observations;
    times[t].reserve(rows.size());
    for (size_t i = 0; i < rows.size(); ++i) {
      times[t].push_back(tracks[t].CoarseRigTimeNs(rows.time_ns(i)));
    }
  }
  return times;
}

}  // namespace rigcal::server
