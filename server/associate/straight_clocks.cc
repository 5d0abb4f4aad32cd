// SPDX-License-Identifier: Apache-2.0
#include "server/associate/straight_clocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/clock_steps.h"
#include "server/associate/stamp_stream.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestRows = 20;        // fewer tell nothing
constexpr size_t kMostWrongTogether = 5;  // rows of one run that single wrong stamps explain
constexpr size_t kMostExchanged = 2;
constexpr double kTimeForRows = 0.6;  // of their periods
// Rows that come later or earlier than their stamps say: by up to so many periods.
constexpr int kMostOutOfPlace = 10;
constexpr double kRepeatShare = 0.1;
constexpr double kBurstShare = 0.3;
constexpr double kInBurst = 0.25;  // of the mean time from row to row
constexpr double kMovedInBurst = 0.5;

int64_t PeriodOf(const std::vector<StampRow>& rows) {
  std::vector<int64_t> steps_ns;
  for (size_t i = 1; i < rows.size(); ++i) {
    const int64_t step_ns = StampDifference(rows[i].time_ns(), rows[i - 1].time_ns());
    if (step_ns > 0) steps_ns.push_back(step_ns);
  }
  return steps_ns.empty() ? 0 : LowerMedian(std::move(steps_ns));
}

// The rows of a longest subsequence whose stamps do not fall (Fredman 1975).
std::vector<bool> LongestInOrder(const std::vector<StampRow>& rows) {
  std::vector<size_t> tails;  // row that ends the best subsequence of each length
  std::vector<size_t> before(rows.size(), rows.size());
  for (size_t i = 0; i < rows.size(); ++i) {
    const auto at = std::ranges::upper_bound(tails, rows[i].time_ns(), {},
                                             [&](size_t row) { return rows[row].time_ns(); });
    if (at != tails.begin()) before[i] = *std::prev(at);
    if (at == tails.end()) {
      tails.push_back(i);
    } else {
      *at = i;
    }
  }
  std::vector<bool> in_order(rows.size(), false);
  for (size_t row = tails.empty() ? rows.size() : tails.back(); row < rows.size();
       row = before[row]) {
    in_order[row] = true;
  }
  return in_order;
}

bool IsSorted(const std::vector<StampRow>& rows) {
  return std::ranges::is_sorted(rows, {}, &StampRow::time_ns);
}

// The rows from `begin` to `end`, out of order, are between others that go on as if nothing had
// been: there is time for them. A clock that was set leaves none.
bool IsExcursion(const StampStream& stream, size_t begin, size_t end) {
  const size_t count = end - begin;
  if (count == 0 || count > kMostWrongTogether) return false;
  // Neighbours that changed places.
  if (count <= kMostExchanged) return true;
  if (begin == 0 || end == stream.rows.size()) return false;
  const double gap_ns = static_cast<double>(
      StampDifference(stream.rows[end].time_ns(), stream.rows[begin - 1].time_ns()));
  return gap_ns >=
         kTimeForRows * static_cast<double>(count + 1) * static_cast<double>(stream.period_ns);
}

// Single wrong stamps, and streams in another order.
void PutInOrder(StampStream* stream, RefusalCounter* refused) {
  std::vector<StampRow>& rows = stream->rows;
  std::set<uint32_t> epochs;
  for (const StampRow& row : rows) epochs.insert(row.observation->clock_epoch);
  // Every few rows the order changes: it says nothing.
  if (rows.size() >= kFewestRows && epochs.size() * 4 > rows.size()) {
    std::ranges::stable_sort(rows, {}, &StampRow::time_ns);
    stream->out_of_order = epochs.size() - 1;
    stream->period_ns = PeriodOf(rows);
    return;
  }
  const std::vector<bool> in_order = LongestInOrder(rows);
  std::vector<size_t> single;
  for (size_t begin = 0; begin < rows.size();) {
    size_t end = begin;
    while (end < rows.size() && !in_order[end]) ++end;
    if (IsExcursion(*stream, begin, end)) {
      for (size_t i = begin; i < end; ++i) single.push_back(i);
    }
    begin = std::max(end, begin) + 1;
  }
  if (single.empty()) return;
  std::vector<int64_t> right_ns;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!std::ranges::binary_search(single, i)) right_ns.push_back(rows[i].time_ns());
  }
  std::ranges::sort(right_ns);
  std::set<size_t> back;
  for (const size_t i : single) {
    const int64_t time_ns = rows[i].time_ns();
    const auto after = std::ranges::lower_bound(right_ns, time_ns);
    const int64_t until_ns = after == right_ns.end() ? std::numeric_limits<int64_t>::max()
                                                     : StampDifference(*after, time_ns);
    const int64_t since_ns = after == right_ns.begin()
                                 ? std::numeric_limits<int64_t>::max()
                                 : StampDifference(time_ns, *std::prev(after));
    const int64_t nearest_ns = std::min(until_ns, since_ns);
    const int64_t before_ns = i > 0 ? rows[i - 1].time_ns() : rows[i + 1].time_ns();
    const int64_t displaced_ns = std::abs(StampDifference(time_ns, before_ns));
    if (nearest_ns >= stream->period_ns / 2 &&
        displaced_ns <= kMostOutOfPlace * stream->period_ns) {
      back.insert(i);
      right_ns.insert(after, time_ns);
      continue;
    }
    stream->wrong[i] = true;
    refused->Add(stream->camera, RefusalReason::kClockEpochWithoutOffset, 1,
                 absl::StrCat("the stamp ", time_ns, " ns is ", SecondsText(displaced_ns),
                              " from those around it"));
  }
  stream->out_of_order = back.size();
  // The rows that stay, in the order of their stamps where they were out of it.
  std::vector<StampRow> kept;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (!stream->wrong[i] && !back.contains(i)) kept.push_back(rows[i]);
  }
  for (const size_t i : back) {
    const auto place = std::ranges::find_if(
        kept, [&](const StampRow& row) { return row.time_ns() > rows[i].time_ns(); });
    kept.insert(place, rows[i]);
  }
  // Behind the others, so that they can be taken away.
  for (size_t i = 0; i < rows.size(); ++i) {
    if (stream->wrong[i]) kept.push_back(rows[i]);
  }
  const auto wrong_count = static_cast<size_t>(std::ranges::count(stream->wrong, true));
  rows = std::move(kept);
  std::fill(stream->wrong.begin(), stream->wrong.end(), false);
  std::fill(stream->wrong.end() - static_cast<std::ptrdiff_t>(wrong_count), stream->wrong.end(),
            true);
}

// Between rows that are stamped close together the wand has moved nearly as far as between others,
// which it does not in the little time that the stamps say.
bool MovesAsMuchInBursts(const StampStream& stream, size_t count, double short_ns, double long_ns) {
  std::vector<double> short_px, long_px;
  for (size_t i = 1; i < count; ++i) {
    const auto& now = stream.rows[i].observation->markers;
    const auto& before = stream.rows[i - 1].observation->markers;
    const auto step_ns = static_cast<double>(
        StampDifference(stream.rows[i].time_ns(), stream.rows[i - 1].time_ns()));
    for (size_t m = 0; m < std::min(now.size(), before.size()); ++m) {
      if (!now[m].visible || !before[m].visible) continue;
      const double moved_px = (now[m].centre_px - before[m].centre_px).norm();
      if (step_ns < short_ns) short_px.push_back(moved_px);
      if (step_ns >= long_ns) long_px.push_back(moved_px);
    }
  }
  if (short_px.size() < kFewestRows || long_px.empty()) return false;
  return UpperMedian(&short_px) > kMovedInBurst * UpperMedian(&long_px);
}

// Rows that the stamps themselves speak against.
void ReportStamps(const StampStream& stream, std::vector<StampFault>* faults) {
  const size_t count = RightRows(stream);
  if (count < kFewestRows) return;
  size_t repeats = 0;
  std::vector<int64_t> steps_ns;
  for (size_t i = 1; i < count; ++i) {
    const int64_t step_ns = StampDifference(stream.rows[i].time_ns(), stream.rows[i - 1].time_ns());
    const auto& now = stream.rows[i].observation->markers;
    const auto& before = stream.rows[i - 1].observation->markers;
    // The same row twice is no fault of the clock.
    const bool is_twice =
        std::ranges::equal(now, before, [](const MarkerObservation& a, const MarkerObservation& b) {
          return a.visible == b.visible && a.centre_px == b.centre_px;
        });
    if (step_ns == 0 && !is_twice) ++repeats;
    if (step_ns > 0) steps_ns.push_back(step_ns);
  }
  const double share = static_cast<double>(repeats) / static_cast<double>(count);
  if (share > kRepeatShare) {
    int64_t tick_ns = std::numeric_limits<int64_t>::max();
    for (const int64_t step_ns : steps_ns) tick_ns = std::min(tick_ns, step_ns);
    faults->push_back(
        {StampFault::Kind::kRepeat, stream.session_id, stream.camera, 100 * share,
         absl::StrFormat("%d of its %d rows have the stamp of the row before: its stamps come in "
                         "ticks of %.4g ms, which is coarser than its rows; write them with all "
                         "their digits",
                         repeats, count,
                         steps_ns.empty() ? 0 : 1e-6 * static_cast<double>(tick_ns))});
    return;
  }
  if (steps_ns.size() < kFewestRows) return;
  // Pauses are no bursts: the mean is taken over the shorter ones.
  std::ranges::sort(steps_ns);
  const size_t middle = steps_ns.size() * 9 / 10;
  double mean_ns = 0;
  for (size_t i = 0; i < middle; ++i) {
    mean_ns += static_cast<double>(steps_ns[i]) / static_cast<double>(middle);
  }
  const auto short_end =
      std::ranges::lower_bound(steps_ns, static_cast<int64_t>(kInBurst * mean_ns));
  const double in_burst =
      static_cast<double>(short_end - steps_ns.begin()) / static_cast<double>(steps_ns.size());
  if (in_burst < kBurstShare || !MovesAsMuchInBursts(stream, count, kInBurst * mean_ns, mean_ns)) {
    return;
  }
  faults->push_back(
      {StampFault::Kind::kBursts, stream.session_id, stream.camera, 100 * in_burst,
       absl::StrFormat(
           "%.0f %% of its rows are stamped within %.3g ms of the row before, though "
           "rows come every %.3g ms on average: stamps of arrival, not of exposure. Take "
           "the camera's own stamps",
           100 * in_burst, 1e-6 * kInBurst * mean_ns, 1e-6 * mean_ns)});
}

bool HaveTimeBase(const std::vector<CameraTrack>& tracks, const std::string& session_id) {
  std::set<std::string> bases;
  for (const CameraTrack& track : tracks) {
    if (track.session_id == session_id) bases.insert(track.camera.clock.timebase);
  }
  return bases.size() == 1 && !bases.begin()->empty();
}

}  // namespace

std::vector<StampFault> StraightenClocks(std::vector<CameraTrack>* tracks, RefusalCounter* refused,
                                         const StepEvidence& evidence) {
  std::map<std::pair<std::string, std::string>, StampStream> streams;
  for (CameraTrack& track : *tracks) {
    StampStream& stream = streams[{track.session_id, track.camera.camera}];
    stream.session_id = track.session_id;
    stream.camera = track.camera.camera;
    stream.has_samples |= std::ranges::any_of(
        track.clock_samples, [](const auto& sample) { return sample.sample.IsOfHost(); });
    for (Observation& observation : track.observations) stream.rows.push_back({&observation});
  }
  std::vector<StampFault> faults;
  std::map<std::string, std::vector<StampStream*>> sessions;
  for (auto& [key, stream] : streams) {
    std::ranges::stable_sort(stream.rows, [](const StampRow& a, const StampRow& b) {
      return std::pair(a.observation->clock_epoch, a.time_ns()) <
             std::pair(b.observation->clock_epoch, b.time_ns());
    });
    stream.wrong.assign(stream.rows.size(), false);
    stream.period_ns = PeriodOf(stream.rows);
    // An epoch with samples of its own needs nothing of this.
    if (stream.has_samples) continue;
    if (!IsSorted(stream.rows)) PutInOrder(&stream, refused);
    ReportStamps(stream, &faults);
    sessions[key.first].push_back(&stream);
    if (stream.out_of_order > 0) {
      faults.push_back({StampFault::Kind::kOutOfOrder, stream.session_id, stream.camera,
                        static_cast<double>(stream.out_of_order),
                        absl::StrCat(stream.out_of_order,
                                     " of its rows were not in the order of their stamps, and were "
                                     "sorted")});
    }
  }
  for (auto& [session_id, all] : sessions) {
    if (HaveTimeBase(*tracks, session_id)) {
      StraightenSession(all, evidence, refused, &faults);
    }
  }
  std::set<const Observation*> wrong;
  for (const auto& [key, stream] : streams) {
    // Rows that were sorted in belong to the epoch around them.
    const size_t count = RightRows(stream);
    const bool is_sorted = std::is_sorted(
        stream.rows.begin(), stream.rows.begin() + static_cast<std::ptrdiff_t>(count),
        [](const StampRow& a, const StampRow& b) { return a.time_ns() < b.time_ns(); });
    const bool is_one = !stream.has_samples && stream.segments.size() < 2 && is_sorted;
    for (size_t i = 0; i < stream.rows.size(); ++i) {
      if (stream.wrong[i]) wrong.insert(stream.rows[i].observation);
      if (is_one) stream.rows[i].observation->clock_epoch = 0;
    }
  }
  if (wrong.empty()) return faults;
  for (CameraTrack& track : *tracks) {
    std::vector<Observation> kept;
    kept.reserve(track.observations.size());
    for (Observation& observation : track.observations) {
      if (!wrong.contains(&observation)) kept.push_back(std::move(observation));
    }
    track.observations = std::move(kept);
  }
  return faults;
}

}  // namespace rigcal::server
