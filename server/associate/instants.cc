// SPDX-License-Identifier: Apache-2.0
#include "server/associate/instants.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "common/associate/row_groups.h"

namespace rigcal::server {
namespace {

// Of the rows with a visible marker.
RowTimes SeenRows(const AlignedTrack& track, const std::vector<int64_t>& rig_time_ns) {
  const ObservationTable& rows = track.track.observations;
  RowTimes seen{track.track.camera.camera, track.FramePeriodS(), {}, {}};
  seen.time_ns.reserve(rows.size());
  seen.row.reserve(rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!rows.AnyVisible(i)) continue;
    seen.time_ns.push_back(rig_time_ns[i]);
    seen.row.push_back(static_cast<int>(i));
  }
  return seen;
}

// Makes an instant of a group; with one camera only it is nobody's instant. `members`: the tracks
// that the group's numbers stand for.
void Close(const RowGroup& group, const std::vector<int>& members, InstantList* list) {
  const auto track_of = [&members](const RowMember& row) {
    return members[static_cast<size_t>(row.track)];
  };
  if (group.size() < 2) {
    ++list->alone_count[static_cast<size_t>(track_of(group.front()))];
    return;
  }
  Instant instant;
  instant.rig_time_ns = MeanTimeNs(group);
  instant.members.reserve(group.size());
  for (const RowMember& row : group) {
    instant.members.push_back({track_of(row), row.row});
    ++list->instant_count[static_cast<size_t>(track_of(row))];
  }
  std::ranges::sort(instant.members, {}, &InstantMember::track);
  list->instants.push_back(std::move(instant));
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
    RowGrouping grouping;
    {
      std::vector<RowTimes> seen;
      seen.reserve(members.size());
      for (const int t : members) {
        const auto track = static_cast<size_t>(t);
        seen.push_back(SeenRows(tracks[track], rig_time_ns[track]));
      }
      grouping = GroupRows(seen, tolerance_s);
    }
    const auto before = static_cast<std::ptrdiff_t>(list.instants.size());
    for (const RowGroup& group : grouping.groups) Close(group, members, &list);
    for (const RowMember& row : grouping.skipped) {
      ++list.skipped_count[static_cast<size_t>(members[static_cast<size_t>(row.track)])];
    }
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
