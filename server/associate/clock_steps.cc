// SPDX-License-Identifier: Apache-2.0
#include "server/associate/clock_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/statistics/robust_statistics.h"
#include "server/associate/stamp_stream.h"

namespace rigcal::server {
namespace {

constexpr size_t kFewestRowsOfStream = 20;  // fewer tell nothing
constexpr size_t kMinRowsOfEpoch = 30;
// Forward steps that are looked at without evidence, and with it.
constexpr int64_t kLeastForwardNs = 10'000'000'000;
constexpr int kLeastForwardPeriods = 50;
constexpr int64_t kLeastSmallNs = 200'000'000;
constexpr int kLeastSmallPeriods = 3;
// From the row before a step to the next one the wand moves by so many times what it moves before
// or behind, at most.
constexpr double kMostMovedOn = 3, kAtRestPx = 2;
constexpr int64_t kTogetherNs = 2'000'000'000;  // steps of several cameras that are one
constexpr int kMostLookedUp = 300;              // rows of an epoch that are looked for in others
constexpr double kClearlyMore = 1.5;            // of its rows are beside those of others

// Sorted stamps of the other cameras of a session.
using Times = std::vector<int64_t>;
using TimesOfOthers = std::function<const Times&(const StampStream*)>;

// The share of the rows, moved, at whose time another camera has a row.
double ShareInCommon(const StampStream& stream, const StampSegment& segment, int64_t moved_ns,
                     const Times& others_ns) {
  const int64_t near_ns = std::max<int64_t>(3 * stream.period_ns, 200'000'000);
  const size_t count = segment.end - segment.begin;
  const size_t step = count / kMostLookedUp + 1;
  size_t looked_up = 0, found = 0;
  for (size_t i = segment.begin; i < segment.end; i += step, ++looked_up) {
    const int64_t time_ns = StampSum(stream.rows[i].time_ns(), moved_ns);
    const auto after = std::ranges::lower_bound(others_ns, StampDifference(time_ns, near_ns));
    found += after != others_ns.end() && StampDifference(*after, time_ns) <= near_ns ? 1 : 0;
  }
  return looked_up == 0 ? 0 : static_cast<double>(found) / static_cast<double>(looked_up);
}

// Where the stream goes on behind a step, if nothing but the clock had changed.
int64_t StepNs(const StampStream& stream, size_t row) {
  const int64_t expected_ns = StampSum(stream.rows[row - 1].time_ns(), stream.period_ns);
  return StampDifference(stream.rows[row].time_ns(), expected_ns);
}

// Whether the wand went on behind row `row` as from any row to the next, which it does where only
// the clock was set. Rows without a marker say nothing against it.
bool GoesOn(const StampStream& stream, size_t row) {
  const auto moved_px = [&stream](size_t to) -> std::optional<double> {
    if (to == 0 || to >= stream.rows.size()) return std::nullopt;
    const auto& now = stream.rows[to].observation->markers;
    const auto& before = stream.rows[to - 1].observation->markers;
    std::vector<double> all_px;
    for (size_t m = 0; m < std::min(now.size(), before.size()); ++m) {
      if (!now[m].visible || !before[m].visible) continue;
      all_px.push_back((now[m].centre_px - before[m].centre_px).norm());
    }
    return all_px.empty() ? std::nullopt : std::optional(UpperMedian(&all_px));
  };
  const std::optional<double> here_px = moved_px(row);
  if (!here_px) return true;
  const double usual_px = std::max(moved_px(row - 1).value_or(0), moved_px(row + 1).value_or(0));
  return *here_px <= kMostMovedOn * usual_px + kAtRestPx;
}

// Rows that may be the first behind a step: all of those back, and those forward that the wand does
// not contradict or that are large.
std::vector<size_t> PossibleSteps(const StampStream& stream, const StepEvidence& evidence) {
  const int64_t large_ns = std::max(kLeastForwardNs, kLeastForwardPeriods * stream.period_ns);
  const int64_t small_ns = std::max(kLeastSmallNs, kLeastSmallPeriods * stream.period_ns);
  std::vector<size_t> steps;
  const size_t count = RightRows(stream);
  for (size_t i = 1; i < count; ++i) {
    const int64_t step_ns = StampDifference(stream.rows[i].time_ns(), stream.rows[i - 1].time_ns());
    const bool is_small = evidence && step_ns >= small_ns && GoesOn(stream, i);
    if (step_ns < 0 || step_ns >= large_ns || is_small) steps.push_back(i);
  }
  return steps;
}

std::optional<bool> Ask(const StepEvidence& evidence, const StampStream& stream,
                        const StampSegment& segment, int64_t stay_ns, int64_t moved_ns) {
  if (!evidence || stay_ns == moved_ns) return std::nullopt;
  StepQuestion question{stream.session_id, stream.camera, {}, stay_ns, moved_ns};
  for (size_t i = segment.begin; i < segment.end; ++i) {
    question.rows.push_back(stream.rows[i].observation);
  }
  return evidence(question);
}

// Whether the clock was set forward before these rows, and not only nothing recorded. `moved_ns`:
// what the steps before it have moved the rows by.
bool IsForwardStep(const StampStream& stream, const StampSegment& rows, int64_t moved_ns,
                   const Times& others_ns, const StepEvidence& evidence) {
  const int64_t step_ns = StepNs(stream, rows.begin);
  // The rows before the first step may be those that are off.
  for (const int64_t base_ns : {moved_ns, int64_t{0}}) {
    const std::optional<bool> says =
        Ask(evidence, stream, rows, base_ns, StampDifference(base_ns, step_ns));
    if (says) return *says;
    if (moved_ns == 0) break;
  }
  if (step_ns < std::max(kLeastForwardNs, kLeastForwardPeriods * stream.period_ns)) return false;
  double as_it_is = 0, moved = 0;
  for (const int64_t base_ns : {moved_ns, int64_t{0}}) {
    as_it_is = std::max(as_it_is, ShareInCommon(stream, rows, base_ns, others_ns));
    moved =
        std::max(moved, ShareInCommon(stream, rows, StampDifference(base_ns, step_ns), others_ns));
  }
  // Else a pause, in which nothing was seen.
  return 2 * as_it_is < moved;
}

void FindSteps(StampStream* stream, const TimesOfOthers& others, const StepEvidence& evidence) {
  const size_t count = RightRows(*stream);
  const std::vector<size_t> possible = PossibleSteps(*stream, evidence);
  stream->segments = {{0, count}};
  int64_t moved_ns = 0;
  for (size_t k = 0; k < possible.size(); ++k) {
    const size_t i = possible[k];
    const bool is_forward = stream->rows[i].time_ns() >= stream->rows[i - 1].time_ns();
    // What is behind the next step says nothing of this one.
    const StampSegment rows = {i, k + 1 < possible.size() ? possible[k + 1] : count};
    if (is_forward && !IsForwardStep(*stream, rows, moved_ns, others(stream), evidence)) continue;
    moved_ns = StampDifference(moved_ns, StepNs(*stream, i));
    stream->segments.back().end = i;
    stream->segments.push_back({i, count});
  }
}

bool StepTogether(const std::vector<StampStream*>& streams) {
  const StampStream* first = nullptr;
  for (const StampStream* stream : streams) {
    if (RightRows(*stream) < kFewestRowsOfStream) continue;
    if (first == nullptr) first = stream;
    if (stream->segments.size() != first->segments.size()) return false;
    for (size_t k = 1; k < first->segments.size(); ++k) {
      const int64_t apart_ns = StampDifference(StepNs(*stream, stream->segments[k].begin),
                                               StepNs(*first, first->segments[k].begin));
      if (std::abs(apart_ns) > kTogetherNs + 2 * first->period_ns) return false;
    }
  }
  return first != nullptr && first->segments.size() > 1;
}

void MoveTogether(const std::vector<StampStream*>& streams) {
  const size_t count = streams.front()->segments.size();
  int64_t moved_ns = 0;
  for (size_t k = 1; k < count; ++k) {
    // So that no camera's rows overlap.
    int64_t least_ns = std::numeric_limits<int64_t>::max();
    for (const StampStream* stream : streams) {
      if (k >= stream->segments.size()) continue;
      least_ns = std::min(least_ns, StepNs(*stream, stream->segments[k].begin));
    }
    moved_ns = StampDifference(moved_ns, least_ns);
    for (StampStream* stream : streams) {
      if (k < stream->segments.size()) stream->segments[k].moved_ns = moved_ns;
    }
  }
}

// The segment whose stamps are right by what the others saw: the first one if any of the moved ones
// belongs where it was moved to, else the longest of those that belong where they are.
std::optional<size_t> RightSegment(const StampStream& stream, const StepEvidence& evidence) {
  std::optional<size_t> longest;
  const auto length = [&stream](size_t k) {
    return stream.segments[k].end - stream.segments[k].begin;
  };
  for (size_t k = 1; k < stream.segments.size(); ++k) {
    const std::optional<bool> says =
        Ask(evidence, stream, stream.segments[k], 0, stream.segments[k].moved_ns);
    if (!says) continue;
    if (*says) return 0;
    if (!longest || length(k) > length(*longest)) longest = k;
  }
  return longest;
}

void MoveAlone(StampStream* stream, const Times& others_ns, const StepEvidence& evidence) {
  int64_t moved_ns = 0;
  size_t reference = 0;
  double best = 0;
  for (size_t k = 0; k < stream->segments.size(); ++k) {
    StampSegment& segment = stream->segments[k];
    if (k > 0) moved_ns = StampDifference(moved_ns, StepNs(*stream, segment.begin));
    segment.moved_ns = moved_ns;
    const double share = ShareInCommon(*stream, segment, 0, others_ns);
    if (share > kClearlyMore * best) best = share, reference = k;
  }
  reference = RightSegment(*stream, evidence).value_or(reference);
  const int64_t kept_ns = stream->segments[reference].moved_ns;
  for (StampSegment& segment : stream->segments) {
    segment.moved_ns = StampDifference(segment.moved_ns, kept_ns);
  }
}

StampFault StepFault(const StampStream& stream, bool together) {
  StampFault fault{StampFault::Kind::kSteps, stream.session_id, stream.camera, 0, ""};
  for (size_t k = 1; k < stream.segments.size(); ++k) {
    const double step_s = 1e-9 * static_cast<double>(StepNs(stream, stream.segments[k].begin));
    if (std::abs(step_s) > std::abs(fault.size)) fault.size = step_s;
  }
  const size_t steps = stream.segments.size() - 1;
  fault.what = absl::StrCat(
      steps == 1 ? "its clock was set once, "
                 : absl::StrCat("its clock was set ", steps, " times, "),
      absl::StrFormat("by %+.6g s", fault.size), steps == 1 ? "" : " at most", ", after ",
      stream.segments[1].begin, " of ", RightRows(stream), " rows; ",
      together ? "all cameras' clocks were set together, and the rows behind are used as they are"
               : "the rows on each side have a clock offset of their own");
  return fault;
}

}  // namespace

void StraightenSession(const std::vector<StampStream*>& streams, const StepEvidence& evidence,
                       RefusalCounter* refused, std::vector<StampFault>* faults) {
  std::map<const StampStream*, Times> known;
  const TimesOfOthers others = [&](const StampStream* stream) -> const Times& {
    Times& times = known[stream];
    if (!times.empty()) return times;
    for (const StampStream* other : streams) {
      if (other == stream) continue;
      for (const StampRow& row : other->rows) times.push_back(row.time_ns());
    }
    std::ranges::sort(times);
    return times;
  };
  for (StampStream* stream : streams) FindSteps(stream, others, evidence);
  const bool together = StepTogether(streams);
  if (together) MoveTogether(streams);
  for (StampStream* stream : streams) {
    if (stream->segments.size() < 2) continue;
    if (!together) MoveAlone(stream, others(stream), evidence);
    size_t used = 0;
    for (size_t k = 0; k < stream->segments.size(); ++k) {
      const StampSegment& segment = stream->segments[k];
      const size_t count = segment.end - segment.begin;
      if (!together && count < kMinRowsOfEpoch) {
        for (size_t i = segment.begin; i < segment.end; ++i) stream->wrong[i] = true;
        refused->Add(stream->camera, RefusalReason::kClockEpochWithoutOffset, count,
                     absl::StrCat("the clock steps by ",
                                  SecondsText(StepNs(*stream, k > 0 ? segment.begin : segment.end)),
                                  ", and ", count,
                                  " rows on one side of the step are too few to find its offset"));
        continue;
      }
      ++used;
    }
    if (used > 1) faults->push_back(StepFault(*stream, together));
    for (size_t k = 0; k < stream->segments.size(); ++k) {
      for (size_t i = stream->segments[k].begin; i < stream->segments[k].end; ++i) {
        Observation& observation = *stream->rows[i].observation;
        observation.clock_epoch = together ? 0 : static_cast<uint32_t>(k);
        observation.time_ns = StampSum(observation.time_ns, stream->segments[k].moved_ns);
      }
    }
  }
}

}  // namespace rigcal::server
