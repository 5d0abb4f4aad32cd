// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/event/blink_wand_timeline.h"

#include <cmath>
#include <utility>

namespace rigcal::agent {
namespace {

constexpr double kWaitPeriods = 0.8;  // then the burst nearest to a time is over
// Limit of one Take: a marker of a few pixels takes more bytes for each period.
constexpr size_t kBytesPerDetection = 8;
constexpr int64_t kLeastDetections = 1000;
constexpr int64_t kSilencePeriods = 20;
constexpr size_t kBytesPerForget = 512;
constexpr int64_t kLeastForgets = 16;
constexpr int64_t kSweepPeriods = 2;

}  // namespace

BlinkWandTimeline::BlinkWandTimeline(BlinkFilter filter, BlinkWandVerifier verifier,
                                     const OutputTimesOptions& output,
                                     absl::InlinedVector<double, 3> marker_period_us)
    : filter_(std::move(filter)),
      verifier_(std::move(verifier)),
      period_us_(filter_.period_us()),
      sweep_us_(static_cast<int64_t>(static_cast<double>(kSweepPeriods) * period_us_)),
      silence_us_(std::min(OutputSchedule::kMaxGapUs, kSilencePeriods * sweep_us_ / kSweepPeriods)),
      schedule_(output, std::llround(kWaitPeriods * period_us_)),
      detections_(period_us_, std::move(marker_period_us), &counts_) {}

void BlinkWandTimeline::Begin(int64_t time_us) {
  begun_ = true;
  reached_us_ = time_us;
  next_sweep_us_ = time_us + sweep_us_;
  schedule_.Start(time_us);
}

void BlinkWandTimeline::BeginTake(size_t byte_count, std::vector<Detection>* found) {
  found_ = found;
  detections_left_ = kLeastDetections + static_cast<int64_t>(byte_count / kBytesPerDetection);
  forgets_left_ = kLeastForgets + static_cast<int64_t>(byte_count / kBytesPerForget);
}

void BlinkWandTimeline::EndTake() {
  counts_.dense_triggers = schedule_.dense_triggers();
  if (!std::exchange(must_forget_, false)) return;
  is_clear_ = true;
  filter_.TimeStepBack(reached_us_);
}

void BlinkWandTimeline::Finish(int64_t time_us, std::vector<Detection>* found) {
  BeginTake(0, found);
  if (begun_) {
    AdvanceTo(time_us);
    Run(reached_us_ + static_cast<int64_t>(kWaitPeriods * period_us_));
  }
  detections_.Finish(found);
}

uint32_t BlinkWandTimeline::Reach(uint32_t time_us) {
  const auto reached = static_cast<uint32_t>(reached_us_);
  AdvanceTo(reached_us_ + static_cast<int32_t>(time_us - reached));
  return NextStop();
}

uint32_t BlinkWandTimeline::TakeTrigger(const TriggerEvent& trigger) {
  AdvanceTo(trigger.time_us);
  schedule_.Take(trigger);
  return NextStop();
}

uint32_t BlinkWandTimeline::StepBack(int64_t time_us) {
  detections_.StepBack(found_);
  Forget(time_us);
  Begin(time_us);
  return NextStop();
}

void BlinkWandTimeline::Forget(int64_t time_us) {
  if (is_clear_) return;
  must_forget_ = forgets_left_ == 0;
  if (must_forget_) return;
  --forgets_left_;
  is_clear_ = true;
  filter_.TimeStepBack(time_us);
}

void BlinkWandTimeline::AdvanceTo(int64_t time_us) {
  if (!begun_) Begin(time_us);
  if (time_us - reached_us_ > silence_us_) {
    // What was due before is still detected; the rest is skipped without a look at every pixel.
    Run(reached_us_ + static_cast<int64_t>(2 * BlinkDetections::kHoldPeriods * period_us_));
    schedule_.Skip(reached_us_, time_us);
    Forget(time_us);
    next_sweep_us_ = time_us + sweep_us_;
  }
  Run(time_us);
  reached_us_ = std::max(reached_us_, time_us);
}

void BlinkWandTimeline::Run(int64_t time_us) {
  while (true) {
    const int64_t due_us = schedule_.due_us();
    if (std::min(due_us, next_sweep_us_) > time_us) return;
    if (due_us <= next_sweep_us_) {
      const OutputTime asked = schedule_.Pop();
      if (asked.trigger || detections_left_ > 0) {
        Detect(asked);
        --detections_left_;
      } else {
        ++counts_.beyond_data;
      }
    } else {
      if (!must_forget_ && !is_clear_) filter_.Sweep(static_cast<uint32_t>(next_sweep_us_));
      next_sweep_us_ += sweep_us_;
    }
  }
}

void BlinkWandTimeline::Detect(const OutputTime& asked) {
  static const std::vector<BlinkBlob> kNone;
  const auto due_us = static_cast<uint32_t>(asked.due_us);
  detections_.Take(asked, verifier_.Verify(must_forget_ ? kNone : filter_.FindBlobs(due_us)),
                   found_);
}

}  // namespace rigcal::agent
