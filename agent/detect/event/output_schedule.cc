// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/output_schedule.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/status/fault_list.h"

namespace rigcal::agent {
namespace {

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();

}  // namespace

absl::Status OutputTimesOptions::Validate() const {
  FaultList faults;
  if (rate_hz != 0 && !(rate_hz >= 10 && rate_hz <= 1000)) {
    faults.Add("rate is ", rate_hz, " Hz, but must be 10 to 1000, or 0");
  }
  if (rate_hz == 0 && trigger == TriggerInstant::kNone) {
    faults.Add("neither a rate nor a trigger is set; one is needed");
  }
  if (trigger_channel < -1 || trigger_channel > 31) {
    faults.Add("trigger_channel is ", trigger_channel, ", not 0 to 31");
  }
  return faults.Result();
}

OutputSchedule::OutputSchedule(const OutputTimesOptions& options, int64_t wait_us)
    : options_(options), wait_us_(wait_us) {}

int64_t OutputSchedule::GridTime(int64_t index) const {
  return std::llround(static_cast<double>(index) * 1e6 / options_.rate_hz);
}

void OutputSchedule::Start(int64_t time_us) {
  triggers_.clear();
  risen_us_.reset();
  last_trigger_us_.reset();
  if (options_.rate_hz > 0) {
    grid_index_ =
        static_cast<int64_t>(std::ceil(static_cast<double>(time_us) * options_.rate_hz / 1e6));
  }
}

void OutputSchedule::Add(int64_t time_us, int64_t known_us) {
  if (last_trigger_us_ && time_us - *last_trigger_us_ < kMinTriggerGapUs) {
    ++dense_triggers_;
    return;
  }
  last_trigger_us_ = time_us;
  triggers_.push_back(
      {.time_us = time_us, .due_us = std::max(time_us + wait_us_, known_us), .trigger = true});
}

void OutputSchedule::Take(const TriggerEvent& trigger) {
  if (options_.trigger_channel >= 0 && trigger.channel != options_.trigger_channel) return;
  switch (options_.trigger) {
    case TriggerInstant::kNone:
      return;
    case TriggerInstant::kRising:
    case TriggerInstant::kFalling:
      if (trigger.rising == (options_.trigger == TriggerInstant::kRising)) {
        Add(trigger.time_us, trigger.time_us);
      }
      return;
    case TriggerInstant::kMiddle:
      if (trigger.rising) {
        risen_us_ = trigger.time_us;
      } else if (risen_us_) {
        Add(*risen_us_ + (trigger.time_us - *risen_us_) / 2, trigger.time_us);
        risen_us_.reset();
      }
      return;
  }
}

void OutputSchedule::Skip(int64_t from_us, int64_t to_us) {
  if (to_us - from_us <= kMaxGapUs || options_.rate_hz <= 0) return;
  while (!triggers_.empty() && triggers_.front().due_us < to_us) triggers_.pop_front();
  const auto next =
      static_cast<int64_t>(std::ceil(static_cast<double>(to_us) * options_.rate_hz / 1e6));
  grid_index_ = std::max(grid_index_, next);
}

int64_t OutputSchedule::due_us() const {
  const int64_t grid_us = options_.rate_hz > 0 ? GridTime(grid_index_) + wait_us_ : kNever;
  return triggers_.empty() ? grid_us : std::min(grid_us, triggers_.front().due_us);
}

OutputTime OutputSchedule::Pop() {
  const int64_t grid_us = options_.rate_hz > 0 ? GridTime(grid_index_) : kNever;
  if (!triggers_.empty() && (grid_us == kNever || triggers_.front().due_us <= grid_us + wait_us_)) {
    const OutputTime next = triggers_.front();
    triggers_.pop_front();
    return next;
  }
  ++grid_index_;
  return {.time_us = grid_us, .due_us = grid_us + wait_us_, .trigger = false};
}

}  // namespace rigcal::agent
