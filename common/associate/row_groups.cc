// SPDX-License-Identifier: Apache-2.0
#include "common/associate/row_groups.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "absl/numeric/int128.h"

namespace rigcal {
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

const std::string& CameraOf(const std::vector<RowTimes>& tracks, const RowMember& view) {
  return tracks[static_cast<size_t>(view.track)].camera;
}

bool Has(const std::vector<RowTimes>& tracks, const RowGroup& group, const std::string& camera) {
  return std::ranges::any_of(
      group, [&](const RowMember& view) { return CameraOf(tracks, view) == camera; });
}

// By time, then track and row.
bool Earlier(const RowMember& a, const RowMember& b) {
  return std::tie(a.time_ns, a.track, a.row) < std::tie(b.time_ns, b.track, b.row);
}

// Cameras that run together: a group ends `tolerance_ns` after its first view, or where a camera
// comes again. `views` ascend here and below.
RowGrouping GroupTogether(const std::vector<RowTimes>& tracks, const std::vector<RowMember>& views,
                          int64_t tolerance_ns) {
  RowGrouping grouping;
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    RowGroup& group = grouping.groups.emplace_back(1, views[begin]);
    for (; end < views.size() && views[end].time_ns - views[begin].time_ns <= tolerance_ns; ++end) {
      if (Has(tracks, group, CameraOf(tracks, views[end]))) break;
      group.push_back(views[end]);
    }
    begin = end;
  }
  return grouping;
}

// Cameras that run freely: of each camera the view nearest the middle of a window of time.
RowGrouping GroupNearest(const std::vector<RowTimes>& tracks, const std::vector<RowMember>& views,
                         int64_t window_ns) {
  RowGrouping grouping;
  for (size_t begin = 0; begin < views.size();) {
    size_t end = begin + 1;
    while (end < views.size() && views[end].time_ns - views[begin].time_ns < window_ns) ++end;
    const int64_t middle_ns = views[begin].time_ns + window_ns / 2;
    std::map<std::string, RowMember> nearest;
    for (size_t i = begin; i < end; ++i) {
      const auto [entry, inserted] = nearest.try_emplace(CameraOf(tracks, views[i]), views[i]);
      if (inserted) continue;
      RowMember& other = entry->second;
      const bool nearer =
          std::abs(views[i].time_ns - middle_ns) < std::abs(other.time_ns - middle_ns);
      grouping.skipped.push_back(nearer ? other : views[i]);
      if (nearer) other = views[i];
    }
    RowGroup& group = grouping.groups.emplace_back();
    for (const auto& [camera, view] : nearest) group.push_back(view);
    std::sort(group.begin(), group.end(), Earlier);
    begin = end;
  }
  return grouping;
}

// Gives each group without a view of the same camera the one of these views of one track that is
// nearest its time (`times_ns`, by group) and up to `reach_ns` away; a view goes to one group at
// most. Returns the others.
std::vector<RowMember> JoinNearest(const std::vector<RowTimes>& tracks,
                                   const std::vector<RowMember>& of_track,
                                   const std::vector<int64_t>& times_ns, int64_t reach_ns,
                                   std::vector<RowGroup>* groups) {
  if (of_track.empty()) return {};
  const std::string& camera = CameraOf(tracks, of_track.front());
  std::vector<bool> joined(of_track.size(), false);
  for (size_t g = 0; g < groups->size(); ++g) {
    RowGroup& group = (*groups)[g];
    if (Has(tracks, group, camera)) continue;
    const auto after = std::ranges::lower_bound(of_track, times_ns[g], {}, &RowMember::time_ns);
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
  std::vector<RowMember> rest;
  for (size_t i = 0; i < of_track.size(); ++i) {
    if (!joined[i]) rest.push_back(of_track[i]);
  }
  return rest;
}

// Median periods of the slowest and the fastest of these tracks; 0 where none has one.
struct Periods {
  double shortest_s = 0, longest_s = 0;
};

Periods PeriodsOf(const std::vector<RowTimes>& tracks, const std::vector<int>& members) {
  Periods periods;
  for (const int track : members) {
    const double own_s = tracks[static_cast<size_t>(track)].frame_period_s;
    if (own_s <= 0) continue;
    if (periods.shortest_s == 0 || own_s < periods.shortest_s) periods.shortest_s = own_s;
    periods.longest_s = std::max(periods.longest_s, own_s);
  }
  return periods;
}

int64_t Nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

// Of the groups of at least two cameras.
struct GroupCounts {
  size_t groups = 0, rows = 0;
  std::vector<uint32_t> shared, alone;  // rows by track

  GroupCounts(const RowGrouping& grouping, size_t tracks) : shared(tracks), alone(tracks) {
    for (const RowGroup& group : grouping.groups) {
      if (group.size() < 2) {
        ++alone[static_cast<size_t>(group.front().track)];
        continue;
      }
      ++groups;
      rows += group.size();
      for (const RowMember& view : group) ++shared[static_cast<size_t>(view.track)];
    }
  }
  // Mean number of cameras per group.
  double CamerasPerGroup() const {
    return groups == 0 ? 0 : static_cast<double>(rows) / static_cast<double>(groups);
  }
};

// A camera that runs at the others' rate, but some constant time beside them, has no part in
// groups that are narrower than that; among many cameras the mean hardly shows it.
bool StarvesTrack(const GroupCounts& together, const GroupCounts& nearest) {
  for (size_t t = 0; t < together.shared.size(); ++t) {
    if (nearest.shared[t] > kStarvedTrackGain * together.shared[t] &&
        together.alone[t] > together.shared[t]) {
      return true;
    }
  }
  return false;
}

struct AlikeGrouping {
  RowGrouping views;
  bool run_freely = false;
};

// Cameras of about one rate.
AlikeGrouping GroupAlike(const std::vector<RowTimes>& tracks, const std::vector<int>& members,
                         const std::vector<RowMember>& views, double tolerance_s,
                         double period_share) {
  const Periods periods = PeriodsOf(tracks, members);
  const double width_s = tolerance_s > 0          ? tolerance_s
                         : periods.shortest_s > 0 ? period_share * periods.shortest_s
                                                  : kToleranceWithoutPeriodS;
  RowGrouping together = GroupTogether(tracks, views, Nanoseconds(width_s));
  if (tolerance_s > 0 || periods.longest_s <= 0) return {std::move(together), false};
  RowGrouping nearest = GroupNearest(tracks, views, Nanoseconds(periods.longest_s));
  const GroupCounts if_together(together, tracks.size()), if_nearest(nearest, tracks.size());
  const bool run_freely =
      if_nearest.CamerasPerGroup() > kFreeRunningGain * if_together.CamerasPerGroup() ||
      StarvesTrack(if_together, if_nearest);
  return {run_freely ? std::move(nearest) : std::move(together), run_freely};
}

// Tracks with rows between those of the slowest.
std::vector<int> FastTracks(const std::vector<RowTimes>& tracks, const std::vector<int>& members) {
  const double longest_s = PeriodsOf(tracks, members).longest_s;
  std::vector<int> fast;
  for (const int track : members) {
    const double own_s = tracks[static_cast<size_t>(track)].frame_period_s;
    if (own_s > 0 && own_s < kFastShare * longest_s) fast.push_back(track);
  }
  return fast;
}

std::vector<RowMember> ViewsOf(const std::vector<RowMember>& views,
                               const std::vector<int>& members) {
  std::vector<RowMember> own;
  std::ranges::copy_if(views, std::back_inserter(own), [&members](const RowMember& view) {
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
RowGrouping GroupByRates(const std::vector<RowTimes>& tracks, const std::vector<int>& members,
                         const std::vector<RowMember>& views, double tolerance_s,
                         double period_share) {
  const std::vector<int> fast = tolerance_s > 0 ? std::vector<int>() : FastTracks(tracks, members);
  if (fast.empty()) return GroupAlike(tracks, members, views, tolerance_s, period_share).views;
  std::vector<int> slow;
  std::set_difference(members.begin(), members.end(), fast.begin(), fast.end(),
                      std::back_inserter(slow));
  AlikeGrouping of_slow = GroupAlike(tracks, slow, ViewsOf(views, slow), tolerance_s, period_share);
  if (of_slow.run_freely)
    return GroupAlike(tracks, members, views, tolerance_s, period_share).views;
  RowGrouping grouping = std::move(of_slow.views);
  std::vector<int64_t> slow_times_ns;
  for (const RowGroup& group : grouping.groups) slow_times_ns.push_back(MeanTimeNs(group));
  std::vector<RowMember> between;
  for (const int track : fast) {
    const double period_s = tracks[static_cast<size_t>(track)].frame_period_s;
    const std::vector<RowMember> rest =
        JoinNearest(tracks, ViewsOf(views, {track}), slow_times_ns,
                    Nanoseconds(kReachPeriods * period_s), &grouping.groups);
    between.insert(between.end(), rest.begin(), rest.end());
  }
  std::ranges::sort(slow_times_ns);
  for (RowGroup& group : grouping.groups) std::sort(group.begin(), group.end(), Earlier);
  std::sort(between.begin(), between.end(), Earlier);
  RowGrouping others = GroupByRates(tracks, fast, between, tolerance_s, kPeriodShareBetween);
  const int64_t slow_period_ns = Nanoseconds(PeriodsOf(tracks, slow).longest_s);
  for (RowGroup& group : others.groups) {
    const bool between_rows =
        group.size() == 1 && IsNear(slow_times_ns, group.front().time_ns, slow_period_ns);
    if (between_rows) grouping.skipped.push_back(group.front());
    if (!between_rows) grouping.groups.push_back(std::move(group));
  }
  grouping.skipped.insert(grouping.skipped.end(), others.skipped.begin(), others.skipped.end());
  return grouping;
}

}  // namespace

int64_t MeanTimeNs(const RowGroup& group) {
  // Of many views of slow cameras it may have more than 64 bits.
  absl::int128 sum = 0;
  for (const RowMember& view : group) sum += view.time_ns - group.front().time_ns;
  return group.front().time_ns + static_cast<int64_t>(sum / static_cast<int64_t>(group.size()));
}

RowGrouping GroupRows(const std::vector<RowTimes>& tracks, double tolerance_s) {
  std::vector<RowMember> views;
  std::vector<int> members;
  size_t count = 0;
  for (const RowTimes& track : tracks) count += track.time_ns.size();
  views.reserve(count);
  for (size_t t = 0; t < tracks.size(); ++t) {
    members.push_back(static_cast<int>(t));
    for (size_t i = 0; i < tracks[t].time_ns.size(); ++i) {
      views.push_back({tracks[t].time_ns[i], static_cast<int>(t), tracks[t].row[i]});
    }
  }
  std::sort(views.begin(), views.end(), Earlier);
  return GroupByRates(tracks, members, views, tolerance_s, kPeriodShare);
}

}  // namespace rigcal
