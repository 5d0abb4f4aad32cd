// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "agent/detect/event/blink_wand_counts.h"
#include "agent/detect/event/blink_wand_verifier.h"
#include "agent/detect/event/output_schedule.h"
#include "agent/identify/detection.h"

namespace rigcal::agent {

// Turns verified wands into detections with times and emits them in the order of these. At the
// fixed rate a detection's time is that of its light, so detections of triggers and of the rate may
// overtake each other; each is held back until none can come before it. One thread at a time.
class BlinkDetections {
 public:
  static constexpr double kHoldPeriods = 2;  // until then detections may overtake

  // `period_us`: the longest; `marker_period_us`: by marker. `counts` must outlive this.
  BlinkDetections(double period_us, absl::InlinedVector<double, 3> marker_period_us,
                  BlinkWandCounts* counts);

  // The detection for `asked`; none at the fixed rate where a marker has had no new burst since its
  // last one. Appends to `found` what need not be held back any longer.
  void Take(const OutputTime& asked, BlinkWand wand, std::vector<Detection>* found);
  // Appends all that is held back.
  void Finish(std::vector<Detection>* found);
  // The clock begins anew, with a new epoch. Appends all that is held back.
  void StepBack(std::vector<Detection>* found);

 private:
  bool SetTimes(const OutputTime& asked, const BlinkWand& wand, Observation* observation);
  void Release(int64_t before_ns, std::vector<Detection>* found);

  int64_t hold_us_;
  absl::InlinedVector<double, 3> marker_period_us_;
  BlinkWandCounts* counts_;
  uint32_t clock_epoch_ = 0;
  absl::InlinedVector<double, 3> last_burst_us_;  // by marker; empty: none yet
  std::optional<int64_t> last_emitted_ns_;
  std::vector<Detection> held_;  // by time
};

}  // namespace rigcal::agent
