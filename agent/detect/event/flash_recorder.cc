// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/flash_recorder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "agent/detect/event/wrapped_time.h"

namespace rigcal::agent {
namespace {

constexpr int kTileShift = BlinkRules::kTileShift;
// Files that were merged are out of order by so much at most.
constexpr int32_t kDisorderUs = 2000;

// The whole of a time of which the lower 32 bits are known.
int64_t WholeTime(int64_t near_us, double time_us) {
  return near_us +
         std::llround(SinceUs(static_cast<double>(static_cast<uint32_t>(near_us)), time_us));
}

}  // namespace

FlashRecorder::FlashRecorder(SensorGeometry geometry)
    : tile_columns_((geometry.width + (1u << kTileShift) - 1) >> kTileShift) {
  const uint32_t rows = (geometry.height + (1u << kTileShift) - 1) >> kTileShift;
  near_.assign(static_cast<size_t>(tile_columns_) * rows, 0);
}

void FlashRecorder::Plan(std::span<const BlinkLight> lights, int64_t now_us, int64_t due_us,
                         bool every, int64_t keep_us) {
  std::erase_if(events_, [&](const PackedEvent& event) {
    return static_cast<int32_t>(static_cast<uint32_t>(now_us) - event.time_us) > keep_us;
  });
  all_from_us_ = all_until_us_ = 0;
  intervals_.clear();
  const auto due = static_cast<double>(static_cast<uint32_t>(due_us));
  for (const BlinkLight& light : lights) {
    const double margin_us = light.MarginUs(), answer_us = light.AnswerUs();
    for (double on_us = light.LastOn(due);; on_us -= light.period_us) {
      const int64_t on = WholeTime(due_us, on_us);
      const auto end_us = static_cast<int64_t>(light.lit_us + answer_us + margin_us);
      if (on + end_us < now_us) break;
      const double off_us = on_us + light.lit_us;
      for (const auto& [begin_us, switch_us] :
           {std::pair{on_us - light.before_us, on_us}, std::pair{off_us, off_us}}) {
        const int64_t from_us = WholeTime(due_us, begin_us - margin_us);
        const int64_t until_us = WholeTime(due_us, switch_us + answer_us + margin_us);
        if (until_us >= now_us) intervals_.push_back({from_us, until_us});
      }
      if (!every) break;
    }
  }
  std::sort(intervals_.begin(), intervals_.end(),
            [](const Interval& a, const Interval& b) { return a.from_us < b.from_us; });
  size_t count = 0;
  for (const Interval& interval : intervals_) {
    if (count > 0 && interval.from_us <= intervals_[count - 1].until_us) {
      intervals_[count - 1].until_us = std::max(intervals_[count - 1].until_us, interval.until_us);
    } else {
      intervals_[count++] = interval;
    }
  }
  intervals_.resize(count);
  Open(now_us);
}

void FlashRecorder::PlanAll(int64_t now_us, int64_t until_us) {
  events_.clear();
  intervals_.assign(1, {now_us, until_us});
  all_from_us_ = now_us;
  all_until_us_ = until_us;
  Open(now_us);
}

void FlashRecorder::Clear() {
  events_.clear();
  intervals_.clear();
  all_from_us_ = all_until_us_ = 0;
  Open(0);
}

void FlashRecorder::Open(int64_t now_us) {
  is_open_ = false;
  next_ = 0;
  next_begin_us_ = intervals_.empty() ? kNever : std::max(now_us, intervals_.front().from_us);
}

void FlashRecorder::Begin(const BlinkFilter& filter) {
  open_ = intervals_[next_++];
  is_open_ = true;
  filter.MarkActive(static_cast<uint32_t>(next_begin_us_), &near_);
  next_begin_us_ = next_ < intervals_.size() ? intervals_[next_].from_us : kNever;
}

void FlashRecorder::Keep(std::span<const PackedEvent> events) {
  const auto from_us = static_cast<uint32_t>(open_.from_us);
  const auto length_us = static_cast<uint32_t>(open_.until_us - open_.from_us);
  const auto since_us = static_cast<int32_t>(events.front().time_us - from_us);
  if (since_us > static_cast<int32_t>(length_us) + kDisorderUs) {
    is_open_ = false;
    return;
  }
  if (events_.size() + events.size() > kMaxEvents) return;
  for (const PackedEvent& event : events) {
    if (event.time_us - from_us > length_us) continue;
    const uint32_t tile = (event.y_polarity & 0x7fffu) >> kTileShift;
    if (near_[tile * tile_columns_ + (event.x >> kTileShift)] != 0) events_.push_back(event);
  }
}

}  // namespace rigcal::agent
