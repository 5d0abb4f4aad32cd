// SPDX-License-Identifier: Apache-2.0
#include "server/associate/repeated_rows.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/clean_track.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestRepeats = 20;  // fewer may be chance, or no matter
constexpr double kCopiedShare = 0.1;
// Of all rows, by what they show: a copy is found in a part of them as well.
constexpr size_t kMostCompared = 1'000'000;

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

uint64_t Mixed(uint64_t hash, uint64_t value) {
  hash = (hash ^ value) * 0x9e3779b97f4a7c15u;
  return hash ^ (hash >> 29);
}

// What a row shows, whenever that was; none of a row without a marker.
std::optional<uint64_t> HashOf(const Observation& row) {
  if (row.VisibleCount() == 0) return std::nullopt;
  uint64_t hash = 1;
  for (size_t m = 0; m < row.markers.size(); ++m) {
    const MarkerObservation& marker = row.markers[m];
    if (!marker.visible) continue;
    hash = Mixed(hash, m);
    hash = Mixed(hash, std::bit_cast<uint64_t>(marker.centre_px.x()));
    hash = Mixed(hash, std::bit_cast<uint64_t>(marker.centre_px.y()));
  }
  return hash;
}

struct Shown {
  uint64_t hash;
  size_t camera;  // of the session
  int64_t time_ns;
};

// The rows of a session's cameras, those that show the same beside each other.
std::vector<Shown> ShownRows(const std::vector<CameraTrack>& tracks,
                             const std::vector<std::vector<RowAt>>& cameras) {
  size_t count = 0;
  for (const std::vector<RowAt>& rows : cameras) count += rows.size();
  const uint64_t stride = 1 + count / kMostCompared;
  std::vector<Shown> shown;
  for (size_t c = 0; c < cameras.size(); ++c) {
    for (const RowAt& at : cameras[c]) {
      const Observation& row = tracks[at.track].observations[at.row];
      const std::optional<uint64_t> hash = HashOf(row);
      if (hash && *hash % stride == 0) shown.push_back({*hash, c, row.time_ns});
    }
  }
  std::ranges::sort(shown, {},
                    [](const Shown& row) { return std::tuple(row.hash, row.camera, row.time_ns); });
  return shown;
}

struct Common {
  std::vector<double> later_s;  // stamps of the second camera minus those of the first, by row
};

// The distance in time of most of these rows, and how many have it.
std::pair<double, size_t> MostAlike(const Common& common, double tolerance_s) {
  std::vector<double> later_s = common.later_s;
  const double median_s = UpperMedian(&later_s);
  const auto count = std::ranges::count_if(
      common.later_s, [&](double value_s) { return std::abs(value_s - median_s) <= tolerance_s; });
  return {median_s, static_cast<size_t>(count)};
}

double PeriodS(const std::vector<Shown>& rows, size_t camera) {
  std::vector<int64_t> times_ns;
  for (const Shown& row : rows) {
    if (row.camera == camera) times_ns.push_back(row.time_ns);
  }
  std::ranges::sort(times_ns);
  std::vector<double> steps_s;
  for (size_t i = 1; i < times_ns.size(); ++i) {
    const double step_ns = static_cast<double>(times_ns[i]) - static_cast<double>(times_ns[i - 1]);
    if (step_ns > 0) steps_s.push_back(1e-9 * step_ns);
  }
  return steps_s.empty() ? 0 : UpperMedian(&steps_s);
}

StampFault CopyFault(const std::string& session_id, const std::string& camera,
                     const std::string& other, size_t count, size_t rows, double later_s,
                     bool is_later) {
  const std::string when = is_later ? absl::StrFormat("stamped %.6g s %s", std::abs(later_s),
                                                      later_s > 0 ? "later" : "earlier")
                                    : "at the same times";
  return {StampFault::Kind::kCopied, session_id, camera,
          100 * static_cast<double>(count) / static_cast<double>(rows),
          absl::StrCat("it has the same rows as ", other, ": ", count, " of its ", rows,
                       " wand views show the same pixels, ", when,
                       ". One of the two cameras' files is a copy of the other's, and nothing says "
                       "which: export both again, or calibrate without these two")};
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
                                   "to itself")});
  }
  TakeAway(std::move(gone), tracks);
  return faults;
}

std::vector<StampFault> FindCopiedRows(const std::vector<CameraTrack>& tracks) {
  std::map<std::string, std::vector<std::string>> names;
  std::map<std::string, std::vector<std::vector<RowAt>>> sessions;
  for (auto& [key, rows] : ByCamera(tracks)) {
    names[key.first].push_back(key.second);
    sessions[key.first].push_back(rows);
  }
  std::vector<StampFault> faults;
  for (const auto& [session_id, cameras] : sessions) {
    const std::vector<Shown> shown = ShownRows(tracks, cameras);
    std::vector<size_t> counts(cameras.size(), 0);
    std::map<std::pair<size_t, size_t>, Common> pairs;  // second camera, first camera
    for (size_t begin = 0; begin < shown.size();) {
      size_t end = begin;
      std::vector<Shown> once;  // of each camera that shows this once only
      while (end < shown.size() && shown[end].hash == shown[begin].hash) {
        size_t next = end;
        while (next < shown.size() && shown[next].hash == shown[end].hash &&
               shown[next].camera == shown[end].camera) {
          ++next;
        }
        counts[shown[end].camera] += next - end;
        if (next - end == 1) once.push_back(shown[end]);
        end = next;
      }
      for (size_t b = 1; b < once.size(); ++b) {
        for (size_t a = 0; a < b; ++a) {
          pairs[{once[b].camera, once[a].camera}].later_s.push_back(
              1e-9 * (static_cast<double>(once[b].time_ns) - static_cast<double>(once[a].time_ns)));
        }
      }
      begin = end;
    }
    size_t named = cameras.size();
    for (const auto& [pair, common] : pairs) {
      const auto& [b, a] = pair;
      if (b == named || common.later_s.size() < kFewestRepeats) continue;
      const double period_s = PeriodS(shown, b);
      const auto [later_s, count] = MostAlike(common, 0.5 * period_s);
      const auto least = static_cast<double>(std::min(counts[a], counts[b]));
      if (count < kFewestRepeats || static_cast<double>(count) < kCopiedShare * least) continue;
      named = b;
      faults.push_back(CopyFault(session_id, names[session_id][b], names[session_id][a], count,
                                 counts[b], later_s, std::abs(later_s) > 1e-6));
    }
  }
  return faults;
}

}  // namespace rigcal::server
