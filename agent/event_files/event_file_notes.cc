// SPDX-License-Identifier: Apache-2.0
// Gaps in a file, and what its events say against the unit that their times are read in. A sensor
// sends hundreds of events a second even where nothing moves, and not 1e9 of them; no recording is
// longer than some days.
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "agent/event_files/event_file_info.h"

namespace rigcal::agent {
namespace {

constexpr uint64_t kFewEvents = 100;  // of which nothing can be said
constexpr uint64_t kFewGaps = 5;      // these may be chance
constexpr double kLowestRateHz = 100;
constexpr double kHighestRateHz = 2e9;
constexpr double kUsualRateHz = 1e5;
constexpr double kLongestS = 11 * 86400.0;
constexpr int64_t kCoarseStepUs = 1000;
constexpr uint64_t kManyEventsPerStep = 4;

std::string DurationText(double seconds) {
  if (seconds >= 2 * 86400.0) return absl::StrFormat("%.1f days", seconds / 86400);
  if (seconds >= 2 * 3600.0) return absl::StrFormat("%.1f hours", seconds / 3600);
  if (seconds >= 0.1) return absl::StrFormat("%.4g s", seconds);
  return absl::StrFormat("%.4g ms", seconds * 1e3);
}

bool IsPossible(double events, double seconds) {
  const double rate_hz = events / seconds;
  return seconds <= kLongestS && rate_hz >= kLowestRateHz && rate_hz <= kHighestRateHz;
}

// The unit in which the events come at the most usual rate; kAuto: none makes them possible.
TimeUnit LikelierUnit(double events, double seconds, TimeUnit unit) {
  TimeUnit best = TimeUnit::kAuto;
  double best_off = 0;
  for (const TimeUnit other : {TimeUnit::kMicroseconds, TimeUnit::kMilliseconds,
                               TimeUnit::kNanoseconds, TimeUnit::kSeconds}) {
    const double its_s = seconds * MicrosecondsOf(other) / MicrosecondsOf(unit);
    if (other == unit || !IsPossible(events, its_s)) continue;
    const double off = std::abs(std::log10(events / its_s / kUsualRateHz));
    if (best == TimeUnit::kAuto || off < best_off) best = other, best_off = off;
  }
  return best;
}

}  // namespace

std::vector<std::string> EventFileInfo::Notes() const {
  std::vector<std::string> notes;
  if (gaps > kFewGaps) {
    notes.push_back(absl::StrFormat(
        "%d gaps, %.1f ms in all (%.1f %% of the time), in which no pixel sends an event while the "
        "scene is busy: data were lost between sensor and file; use a USB port and cable of its "
        "own, a faster disk, or fewer events (higher thresholds, smaller aperture)",
        gaps, static_cast<double>(gap_us) / 1e3,
        100 * static_cast<double>(gap_us) / static_cast<double>(duration_us)));
  }
  if (header.format != EventFormat::kPlain || cd_events < kFewEvents) return notes;
  const auto events = static_cast<double>(cd_events);
  const double seconds = static_cast<double>(duration_us) / 1e6;
  constexpr char kTooFewDigits[] =
      ": they were stored with too few digits (32-bit floats hold 7); store them as whole "
      "microseconds or 64-bit floats";
  if (step_count == 0) {
    notes.push_back(absl::StrCat("all ", cd_events, " events have one time", kTooFewDigits));
  } else if (shortest_step_us >= kCoarseStepUs && step_count * kManyEventsPerStep <= cd_events) {
    notes.push_back(absl::StrCat("times come in steps of ",
                                 DurationText(static_cast<double>(shortest_step_us) / 1e6),
                                 " or more, with many events each", kTooFewDigits));
  } else if (seconds > 0 && !IsPossible(events, seconds)) {
    const TimeUnit unit = header.time_unit;
    std::string note = absl::StrCat(cd_events, " events over ", DurationText(seconds),
                                    " cannot be ", TimeUnitName(unit));
    if (const TimeUnit other = LikelierUnit(events, seconds, unit); other != TimeUnit::kAuto) {
      absl::StrAppend(&note, "; use time=", TimeUnitOption(other), " (here --time ",
                      TimeUnitOption(other), "), which makes them ",
                      DurationText(seconds * MicrosecondsOf(other) / MicrosecondsOf(unit)));
    }
    notes.push_back(note);
  }
  if (on_events == 0 || off_events() == 0) {
    notes.push_back(absl::StrCat("all events are ", on_events == 0 ? "OFF" : "ON",
                                 ": a polarity of -1 in unsigned bytes (255) is read as ON; write "
                                 "0 and 1"));
  }
  return notes;
}

}  // namespace rigcal::agent
