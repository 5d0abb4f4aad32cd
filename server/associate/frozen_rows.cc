// SPDX-License-Identifier: Apache-2.0
#include "server/associate/frozen_rows.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "server/associate/shown_rows.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestFrozen = 20;  // rows of a run
constexpr size_t kFewestMoving = 5;   // views of another camera at that time
constexpr double kMovedShare = 0.01;  // of the image's width, by a marker of another camera

// Rows of one camera in one session, in the order of their clock epochs and stamps.
struct CameraRows {
  double width_px = 0;
  std::vector<const Observation*> rows;
};
using CameraKey = std::pair<std::string, std::string>;  // session, camera

std::map<CameraKey, CameraRows> RowsByCamera(const TargetOfSession& target_of,
                                             const std::vector<CameraTrack>& tracks) {
  std::map<CameraKey, CameraRows> all;
  for (const CameraTrack& track : tracks) {
    if (target_of(track.session_id).IsStatic()) continue;
    CameraRows& own = all[{track.session_id, track.camera.camera}];
    own.width_px = track.camera.image_size_px.width;
    for (const Observation& row : track.observations) {
      if (row.VisibleCount() > 0) own.rows.push_back(&row);
    }
  }
  for (auto& [key, own] : all) {
    std::ranges::stable_sort(own.rows, {}, [](const Observation* row) {
      return std::pair(row->clock_epoch, row->time_ns);
    });
  }
  return all;
}

// A run of rows, from the first to behind the last.
struct Run {
  size_t begin = 0, end = 0;
};

std::vector<Run> EqualRuns(const std::vector<const Observation*>& rows) {
  std::vector<Run> runs;
  for (size_t begin = 0; begin < rows.size();) {
    const std::optional<uint64_t> shown = HashOfShown(*rows[begin]);
    size_t end = begin + 1;
    while (end < rows.size() && HashOfShown(*rows[end]) == shown) ++end;
    if (end - begin >= kFewestFrozen) runs.push_back({begin, end});
    begin = end;
  }
  return runs;
}

// How far a camera saw its markers move between two stamps, any marker and axis; none where it
// hardly saw them.
std::optional<double> MovedPx(const CameraRows& camera, int64_t from_ns, int64_t to_ns) {
  std::map<size_t, std::pair<Eigen::Array2d, Eigen::Array2d>> range_px;  // by marker
  size_t views = 0;
  for (const Observation* row : camera.rows) {
    if (row->time_ns < from_ns || row->time_ns > to_ns) continue;
    ++views;
    for (size_t m = 0; m < row->markers.size(); ++m) {
      if (!row->markers[m].visible || !row->markers[m].centre_px.allFinite()) continue;
      const Eigen::Array2d at_px = row->markers[m].centre_px.array();
      auto& [least, most] = range_px.try_emplace(m, at_px, at_px).first->second;
      least = least.min(at_px);
      most = most.max(at_px);
    }
  }
  if (views < kFewestMoving) return std::nullopt;
  double moved_px = 0;
  for (const auto& [marker, range] : range_px) {
    moved_px = std::max(moved_px, (range.second - range.first).maxCoeff());
  }
  return moved_px;
}

// Most of the other cameras of its session that saw the target then saw it move.
bool OthersMoved(const std::map<CameraKey, CameraRows>& all, const CameraKey& key, int64_t from_ns,
                 int64_t to_ns) {
  int moved = 0, seen = 0;
  for (const auto& [other, rows] : all) {
    if (other.first != key.first || other == key) continue;
    const std::optional<double> moved_px = MovedPx(rows, from_ns, to_ns);
    if (!moved_px) continue;
    ++seen;
    moved += *moved_px >= kMovedShare * rows.width_px ? 1 : 0;
  }
  return 2 * moved > seen;
}

}  // namespace

std::vector<StampFault> TakeFrozenRows(const TargetOfSession& target_of,
                                       std::vector<CameraTrack>* tracks, RefusalCounter* refused) {
  const std::map<CameraKey, CameraRows> all = RowsByCamera(target_of, *tracks);
  std::vector<StampFault> faults;
  std::vector<const Observation*> gone;
  for (const auto& [key, own] : all) {
    size_t frozen = 0;
    Run longest;
    for (const Run& run : EqualRuns(own.rows)) {
      if (!OthersMoved(all, key, own.rows[run.begin]->time_ns, own.rows[run.end - 1]->time_ns)) {
        continue;
      }
      gone.insert(gone.end(), own.rows.begin() + static_cast<std::ptrdiff_t>(run.begin) + 1,
                  own.rows.begin() + static_cast<std::ptrdiff_t>(run.end));
      frozen += run.end - run.begin;
      if (run.end - run.begin > longest.end - longest.begin) longest = run;
    }
    if (frozen == 0) continue;
    const double from_s = 1e-9 * (static_cast<double>(own.rows[longest.begin]->time_ns) -
                                  static_cast<double>(own.rows.front()->time_ns));
    const double length_s = 1e-9 * (static_cast<double>(own.rows[longest.end - 1]->time_ns) -
                                    static_cast<double>(own.rows[longest.begin]->time_ns));
    faults.push_back(
        {StampFault::Kind::kFrozen, key.first, key.second,
         100 * static_cast<double>(frozen) / static_cast<double>(own.rows.size()),
         absl::StrCat(
             frozen, " of its ", own.rows.size(),
             " wand views show the same pixels as the row before while other cameras see the wand "
             "move: its image is frozen, ",
             absl::StrFormat("for %.1f s from second %.1f of its recording on. ", length_s, from_s),
             "These rows were left out; look for a camera or a video that stopped, and record "
             "again")});
    refused->Add(key.second, RefusalReason::kDuplicateEqual, frozen - 1,
                 "the same pixels as the row before while others see the wand move");
  }
  std::ranges::sort(gone);
  for (CameraTrack& track : *tracks) {
    if (gone.empty()) break;
    std::vector<Observation> kept;
    for (Observation& row : track.observations) {
      if (!std::ranges::binary_search(gone, &row)) kept.push_back(std::move(row));
    }
    track.observations = std::move(kept);
  }
  return faults;
}

}  // namespace rigcal::server
