// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "agent/detect/event/blink_detections.h"
#include "agent/detect/event/blink_filter.h"
#include "agent/detect/event/blink_wand_counts.h"
#include "agent/detect/event/blink_wand_verifier.h"
#include "agent/detect/event/output_schedule.h"
#include "agent/event/event.h"

namespace rigcal::agent {

// What BlinkWandDetector does as the sensor's clock goes on: asks the filter and the judge when
// OutputSchedule wants an answer, has the filter swept, lets it forget when the clock jumps. One
// thread at a time.
class BlinkWandTimeline {
 public:
  // `marker_period_us`: by marker.
  BlinkWandTimeline(BlinkFilter filter, BlinkWandVerifier judge, const OutputTimesOptions& output,
                    absl::InlinedVector<double, 3> marker_period_us);
  BlinkWandTimeline(const BlinkWandTimeline&) = delete;
  BlinkWandTimeline& operator=(const BlinkWandTimeline&) = delete;

  // Around what decoding `byte_count` bytes brings; answers are appended to `found` until the next
  // one.
  void BeginTake(size_t byte_count, std::vector<Detection>* found);
  void EndTake();

  // The clock begins.
  void Begin(int64_t time_us);
  bool has_begun() const { return begun_; }
  void AdvanceTo(int64_t time_us);
  // The stream has ended at this time: answers what was asked until then and tells all.
  void Finish(int64_t time_us, std::vector<Detection>* found);

  // Called while decoding; each returns when to be called next.
  uint32_t Reach(uint32_t time_us);
  uint32_t TakeTrigger(const TriggerEvent& trigger);
  uint32_t StepBack(int64_t time_us);
  uint32_t NextStop() const {
    return static_cast<uint32_t>(std::min(next_sweep_us_, schedule_.due_us()));
  }

  // Where events go; to be told when some do.
  BlinkFilter::Pass BeginPass() { return filter_.BeginPass(); }
  void NoteEvents() { is_clear_ = false; }

  const BlinkWandCounts& counts() const { return counts_; }

 private:
  // All pixels, which takes as long as many events; while the clock jumps all the time it is put
  // off to the end of a Take, and no blob is seen until then.
  void Forget(int64_t time_us);
  void Run(int64_t time_us);
  void Answer(const OutputTime& asked);

  BlinkFilter filter_;
  BlinkWandVerifier judge_;
  const double period_us_;  // the longest
  const int64_t sweep_us_;
  const int64_t silence_us_;  // after which no pixel blinks any more
  OutputSchedule schedule_;
  BlinkWandCounts counts_;
  BlinkDetections answers_;

  bool begun_ = false;
  int64_t reached_us_ = 0;
  int64_t next_sweep_us_ = 0;
  int64_t answers_left_ = 0;  // at the fixed rate, in this Take
  int64_t forgets_left_ = 0;
  bool is_clear_ = true;  // no event has come to the filter since it forgot all
  // The filter holds what is no longer so.
  bool must_forget_ = false;
  std::vector<Detection>* found_ = nullptr;
};

}  // namespace rigcal::agent
