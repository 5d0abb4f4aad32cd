// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "agent/detect/event/answers_choice.h"
#include "agent/detect/event/blink_detections.h"
#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/flash_measurer.h"
#include "agent/detect/event/lamp_flicker.h"
#include "agent/event/event_gaps.h"

namespace rigcal::agent {

// Drives BlinkWandDetector by the sensor's clock: detects the wand when OutputSchedule says so,
// sweeps the filter, and clears it when the clock jumps. Of a wand whose light is not known yet
// (BlinkLights) everything is recorded for two periods; until then its centres are those of the
// pixels that lit up. Where pixels answer one switch of the light only (AnswersChoice), nothing has
// to be recorded first; where what was recorded shows no fall, they are those of the rise. One
// thread at a time.
class BlinkWandTimeline {
 public:
  // `marker_period_us`: by marker.
  BlinkWandTimeline(BlinkFilter filter, BlinkWandVerifier verifier,
                    const OutputTimesOptions& output,
                    absl::InlinedVector<double, 3> marker_period_us);
  BlinkWandTimeline(const BlinkWandTimeline&) = delete;
  BlinkWandTimeline& operator=(const BlinkWandTimeline&) = delete;

  // Before and after decoding `byte_count` bytes; detections are appended to `found` until the next
  // one.
  void BeginTake(size_t byte_count, std::vector<Detection>* found);
  void EndTake();

  // The clock begins.
  void Begin(int64_t time_us);
  bool has_begun() const { return begun_; }
  void AdvanceTo(int64_t time_us);
  // The stream has ended at this time: detects what is due until then and emits all.
  void Finish(int64_t time_us, std::vector<Detection>* found);

  // Called while decoding; each returns when to be called next.
  uint32_t Reach(uint32_t time_us);
  uint32_t TakeTrigger(const TriggerEvent& trigger);
  uint32_t StepBack(int64_t time_us);
  uint32_t NextStop() const { return static_cast<uint32_t>(NextDue()); }

  // None of them behind the next stop.
  void Feed(std::span<const PackedEvent> events) {
    if (events.empty()) return;
    if (gaps_.MayHold(events)) [[unlikely]] {
      events = FeedUpToGaps(events);
      if (events.empty()) return;
    } else {
      gaps_.Pass(events);
    }
    FeedWhole(events);
  }

  const BlinkWandCounts& counts() const { return counts_; }
  std::vector<LampReading> TakeLampReadings() { return lamps_.TakeReadings(); }

 private:
  // All pixels, which takes as long as many events; while the clock jumps all the time it is put
  // off to the end of a Take, and no blob is seen until then.
  void Forget(int64_t time_us);
  void Run(int64_t time_us);
  // Of whatever is to be done next.
  int64_t NextDue() const {
    const int64_t learned_us = is_learning_ ? learn_until_us_ : FlashRecorder::kNever;
    return std::min({next_sweep_us_, schedule_.due_us(), recorder_.next_begin_us(), learned_us});
  }
  void FeedWhole(std::span<const PackedEvent> events) {
    is_clear_ = false;
    counts_.events += events.size();
    lamps_.Take(events);
    filter_.Events(events);
    if (trial_) trial_->filter.Events(events);
    recorder_.Take(events);
  }
  // What is left of them has no gap before it.
  std::span<const PackedEvent> FeedUpToGaps(std::span<const PackedEvent> events);
  void Bridge(uint32_t from_us, uint32_t until_us);
  // After each detection.
  void CountLosses(int64_t due_us, const BlinkWand& wand);
  // Blobs whose last burst would have been in a gap are of the last one that was not.
  void DateBlobs(uint32_t due_us);
  void DetectNext();
  void Detect(const OutputTime& asked);
  void Learn(int64_t now_us);
  // After each detection, whether it found the wand.
  void ChooseAnswers(int64_t now_us, bool is_wand);
  void PlanRecording(int64_t now_us);

  // Of other switches than those that are used, beside them.
  struct Trial {
    BlinkFilter filter;
    BlinkWandVerifier verifier;
  };

  BlinkFilter filter_;
  BlinkWandVerifier verifier_;
  const double period_us_;  // the longest
  const int64_t sweep_us_;
  const int64_t silence_us_;  // after which no pixel blinks any more
  OutputSchedule schedule_;
  EventGaps gaps_;
  const size_t marker_count_;
  BlinkWandCounts counts_;
  BlinkDetections detections_;
  AnswersChoice answers_;
  std::optional<Trial> trial_;
  BlinkLights lights_;
  FlashRecorder recorder_;
  FlashMeasurer flashes_;
  LampFlicker lamps_;
  std::vector<BlinkBlob> blobs_;
  const bool records_every_burst_;  // when detections are asked for is not known in advance

  int64_t learn_until_us_ = 0;  // everything is recorded until then
  bool is_learning_ = false;
  int64_t learn_from_us_ = 0;  // a light that was not found is looked for again then
  bool rise_alone_ = false;    // what was recorded shows no fall: centres are those of the rise

  bool begun_ = false;
  int64_t reached_us_ = 0;
  int64_t next_sweep_us_ = 0;
  int64_t detections_left_ = 0;  // at the fixed rate, in this Take
  int64_t forgets_left_ = 0;
  // Of every pixel for missed blinks, in this Take, and not before that time.
  int64_t looks_left_ = 0, next_look_us_ = 0;
  bool is_clear_ = true;  // no event has come to the filter since it forgot all
  // The filter holds outdated states.
  bool must_forget_ = false;
  std::vector<Detection>* found_ = nullptr;
};

}  // namespace rigcal::agent
