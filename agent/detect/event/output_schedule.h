// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "absl/status/status.h"
#include "agent/event/event.h"

namespace rigcal::agent {

// The instant of a pulse at the external-trigger input that counts.
enum class TriggerInstant : uint8_t { kNone, kRising, kFalling, kMiddle };

struct OutputTimesOptions {
  double rate_hz = 200;  // 10 to 1000; 0: no fixed rate
  TriggerInstant trigger = TriggerInstant::kNone;
  int trigger_channel = -1;  // 0 to 31; -1: every channel

  // Every fault; at least one of rate and trigger must be there.
  absl::Status Validate() const;
};

struct OutputTime {
  int64_t time_us = 0;   // requested, the sensor's clock
  int64_t due_us = 0;    // when the wand can be detected for it
  bool trigger = false;  // else of the fixed rate
};

// The times at which an event camera detects the wand: at triggers, at a fixed rate (whole
// multiples of its period on the sensor's clock, so that sensors with one clock agree), or both.
// Each is due `wait_us` later, when the burst of light nearest to it is over.
class OutputSchedule {
 public:
  // Triggers closer together are noise at the input.
  static constexpr int64_t kMinTriggerGapUs = 400;
  // In longer gaps there is no output at the fixed rate.
  static constexpr int64_t kMaxGapUs = 1'000'000;

  OutputSchedule(const OutputTimesOptions& options, int64_t wait_us);

  // The clock begins, or begins anew: forgets all triggers.
  void Start(int64_t time_us);
  void Take(const TriggerEvent& trigger);
  // Nothing is known between these times.
  void Skip(int64_t from_us, int64_t to_us);

  // Of the next one; the largest number: none.
  int64_t due_us() const;
  OutputTime Pop();

  uint64_t dense_triggers() const { return dense_triggers_; }

 private:
  int64_t GridTime(int64_t index) const;
  void Add(int64_t time_us, int64_t known_us);

  OutputTimesOptions options_;
  int64_t wait_us_;
  int64_t grid_index_ = 0;  // of the next one
  std::deque<OutputTime> triggers_;
  std::optional<int64_t> risen_us_;
  std::optional<int64_t> last_trigger_us_;
  uint64_t dense_triggers_ = 0;
};

}  // namespace rigcal::agent
