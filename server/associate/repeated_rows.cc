// SPDX-License-Identifier: Apache-2.0
#include "server/associate/repeated_rows.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/associate/clean_track.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestRepeats = 20;  // fewer may be chance, or no matter

struct RowAt {
  size_t track, row;
};
using RowsOfCamera = std::map<std::pair<std::string, std::string>, std::vector<RowAt>>;

RowsOfCamera ByCamera(const std::vector<CameraTrack>& tracks) {
  RowsOfCamera all;
  for (size_t t = 0; t < tracks.size(); ++t) {
    std::vector<RowAt>& rows = all[{tracks[t].session_id, tracks[t].camera.camera}];
    for (size_t i = 0; i < tracks[t].observations.size(); ++i) rows.push_back({t, i});
  }
  return all;
}

// The later ones of rows that are the same, of one camera.
std::vector<RowAt> Repeats(const std::vector<CameraTrack>& tracks, std::vector<RowAt> rows) {
  const auto of = [&tracks](const RowAt& at) -> const Observation& {
    return tracks[at.track].observations[at.row];
  };
  const auto is_before = [&of](const RowAt& a, const RowAt& b) {
    return std::pair(of(a).time_ns, of(a).clock_epoch) <
           std::pair(of(b).time_ns, of(b).clock_epoch);
  };
  std::ranges::stable_sort(rows, is_before);
  std::vector<RowAt> repeats;
  for (size_t begin = 0; begin < rows.size();) {
    size_t end = begin + 1;
    while (end < rows.size() && of(rows[end]).time_ns == of(rows[begin]).time_ns) ++end;
    for (size_t i = begin + 1; i < end; ++i) {
      const auto is_same = [&](const RowAt& at) { return SameValues(of(at), of(rows[i])); };
      if (std::any_of(rows.begin() + static_cast<std::ptrdiff_t>(begin),
                      rows.begin() + static_cast<std::ptrdiff_t>(i), is_same)) {
        repeats.push_back(rows[i]);
      }
    }
    begin = end;
  }
  return repeats;
}

void TakeAway(std::vector<std::vector<size_t>> rows_of_track, std::vector<CameraTrack>* tracks) {
  for (size_t t = 0; t < tracks->size(); ++t) {
    std::vector<size_t>& gone = rows_of_track[t];
    if (gone.empty()) continue;
    std::ranges::sort(gone);
    std::vector<Observation>& rows = (*tracks)[t].observations;
    std::vector<Observation> kept;
    kept.reserve(rows.size() - gone.size());
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!std::ranges::binary_search(gone, i)) kept.push_back(std::move(rows[i]));
    }
    rows = std::move(kept);
  }
}

}  // namespace

std::vector<StampFault> UseRepeatedRowsOnce(std::vector<CameraTrack>* tracks,
                                            RefusalCounter* refused) {
  std::vector<StampFault> faults;
  std::vector<std::vector<size_t>> gone(tracks->size());
  for (const auto& [key, rows] : ByCamera(*tracks)) {
    const std::vector<RowAt> repeats = Repeats(*tracks, rows);
    const auto of = [tracks](const RowAt& at) -> const Observation& {
      return (*tracks)[at.track].observations[at.row];
    };
    const auto views = static_cast<size_t>(
        std::ranges::count_if(repeats, [&](const RowAt& at) { return of(at).VisibleCount() > 0; }));
    if (views == 0) continue;
    for (const RowAt& at : repeats) gone[at.track].push_back(at.row);
    const Observation& first = of(repeats.front());
    refused->Add(key.second, RefusalReason::kDuplicateEqual, repeats.size(),
                 absl::StrCat("time ", first.time_ns, " ns, clock epoch ", first.clock_epoch));
    if (views < kFewestRepeats) continue;
    faults.push_back({StampFault::Kind::kTwice, key.first, key.second,
                      static_cast<double>(repeats.size()),
                      absl::StrCat(repeats.size(), " of its ", rows.size(),
                                   " rows come a second time, with the same stamp and the same "
                                   "pixels, and were used once: look for a file that was appended "
                                   "to itself, or for a recorded or simulated camera whose agent "
                                   "was started again")});
  }
  TakeAway(std::move(gone), tracks);
  return faults;
}

}  // namespace rigcal::server
