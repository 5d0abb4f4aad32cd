// SPDX-License-Identifier: Apache-2.0
#include "agent/event/event_gaps.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rigcal::agent {
namespace {

// Longest silences of so many windows, a blink period or a millisecond each, say what is usual: the
// lower quartile, as many windows may hold a gap.
constexpr size_t kWindows = 32, kQuartile = kWindows / 4;
constexpr double kLeastWindowUs = 1000;
// Of what is usual. Events that come by chance leave the five times longest silence once in hours.
constexpr int32_t kTimesUsual = 5;
// A scene that is usually silent for longer is not busy: its silence tells nothing.
constexpr int32_t kBusyUs = 200;
// None before what is usual is known.
constexpr int32_t kUnknownUs = std::numeric_limits<int32_t>::max();
constexpr size_t kGapsKept = 32;

}  // namespace

EventGaps::EventGaps(double period_us, int64_t longest_us)
    : window_us_(static_cast<uint32_t>(std::max(kLeastWindowUs, period_us))),
      longest_us_(longest_us),
      threshold_us_(kUnknownUs) {}

void EventGaps::Restart() {
  has_begun_ = false;
  usual_us_.clear();
  next_usual_ = 0;
  longest_in_window_us_ = 0;
  threshold_us_ = kUnknownUs;
  gaps_.clear();
}

void EventGaps::Learn() {
  const uint32_t windows = (last_us_ - window_from_us_) / window_us_;
  if (windows < 1) return;
  window_from_us_ += windows * window_us_;
  // In those behind the first one nothing had to be looked for.
  for (size_t i = 0; i < std::min<size_t>(kWindows, windows); ++i) {
    const int32_t silence_us = i == 0 ? longest_in_window_us_ : 0;
    if (usual_us_.size() < kWindows) {
      usual_us_.push_back(silence_us);
    } else {
      usual_us_[next_usual_++ % kWindows] = silence_us;
    }
  }
  longest_in_window_us_ = 0;
  if (usual_us_.size() < kWindows) return;
  sorted_us_ = usual_us_;
  std::nth_element(sorted_us_.begin(), sorted_us_.begin() + kQuartile, sorted_us_.end());
  const int32_t usual_us = sorted_us_[kQuartile];
  threshold_us_ = usual_us > kBusyUs ? kUnknownUs : std::max(kLeastUs, kTimesUsual * usual_us);
}

size_t EventGaps::Next(std::span<const PackedEvent> events) {
  if (!has_begun_) {
    has_begun_ = true;
    last_us_ = window_from_us_ = events.front().time_us;
  }
  for (size_t i = 0; i < events.size(); ++i) {
    const uint32_t time_us = events[i].time_us;
    const auto silence_us = static_cast<int32_t>(time_us - last_us_);
    if (silence_us <= 0) continue;  // files that were merged are out of order by a little
    Learn();
    longest_in_window_us_ = std::max(longest_in_window_us_, silence_us);
    // Windows within it count once.
    window_from_us_ += static_cast<uint32_t>(silence_us) / window_us_ * window_us_;
    const bool is_gap = silence_us >= threshold_us_ && silence_us <= longest_us_;
    const uint32_t before_us = last_us_;
    last_us_ = time_us;
    if (!is_gap) continue;
    if (gaps_.size() == kGapsKept) gaps_.erase(gaps_.begin());
    gaps_.push_back({before_us, time_us});
    ++count_;
    total_us_ += static_cast<uint64_t>(silence_us);
    return i;
  }
  return events.size();
}

bool EventGaps::Overlap(uint32_t from_us, uint32_t until_us) const {
  const auto is_before = [](uint32_t a_us, uint32_t b_us) {
    return static_cast<int32_t>(b_us - a_us) > 0;
  };
  for (const Gap& gap : gaps_) {
    if (is_before(from_us, gap.until_us) && is_before(gap.from_us, until_us)) return true;
  }
  return IsOpenAt(until_us);
}

}  // namespace rigcal::agent
