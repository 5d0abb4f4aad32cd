// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_lights.h"

namespace rigcal::agent {

// Keeps the events with which pixels near blinking ones answer the rise and the fall of a light: a
// small part of all, and of all times only those around the burst that a detection will be of.
// Times are the sensor's clock. One thread at a time.
class FlashRecorder {
 public:
  static constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

  // More are not kept.
  static constexpr size_t kMaxEvents = size_t{1} << 17;

  explicit FlashRecorder(SensorGeometry geometry);

  // From `now_us` on keeps the flashes of the last burst of each light that is over at `due_us`,
  // or of every burst until then. Forgets what was kept longer than `keep_us` ago.
  void Plan(std::span<const BlinkLight> lights, int64_t now_us, int64_t due_us, bool every,
            int64_t keep_us);
  // Keeps all events near blinking pixels from `now_us` on until then, and nothing else.
  void PlanAll(int64_t now_us, int64_t until_us);
  void Clear();

  // Begin must be called then, before any event of that time or later is given to Take.
  int64_t next_begin_us() const { return next_begin_us_; }
  void Begin(const BlinkFilter& filter);

  // The next events of the stream.
  void Take(std::span<const PackedEvent> events) {
    if (is_open_) Keep(events);
  }

  std::span<const PackedEvent> events() const { return events_; }
  // All events near blinking pixels were kept between these times; none if they are the same.
  int64_t all_from_us() const { return all_from_us_; }
  int64_t all_until_us() const { return all_until_us_; }

 private:
  struct Interval {
    int64_t from_us = 0, until_us = 0;
  };
  void Open(int64_t now_us);
  void Keep(std::span<const PackedEvent> events);

  uint32_t tile_columns_;
  std::vector<Interval> intervals_;  // by time, apart from each other
  size_t next_ = 0;                  // of them, the first that has not begun
  int64_t next_begin_us_ = kNever;
  bool is_open_ = false;
  Interval open_;
  int64_t all_from_us_ = 0, all_until_us_ = 0;
  std::vector<uint8_t> near_;  // by tile
  std::vector<PackedEvent> events_;
};

}  // namespace rigcal::agent
