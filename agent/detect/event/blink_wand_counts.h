// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/target/detection_outcome.h"

namespace rigcal::agent {

// Counts of a BlinkWandDetector since Create.
struct BlinkWandCounts {
  DetectionCounts by_outcome;  // one for each detection
  // At the fixed rate, before every marker had a new burst: not emitted again.
  uint64_t same_burst = 0;
  uint64_t out_of_order = 0;  // older than the last one emitted, left out
  // Wands by pixels that answer only the rise, or only the fall, of the light (PixelAnswers).
  uint64_t by_rise = 0, by_fall = 0;
  uint64_t dense_triggers = 0;  // closer together than 0.4 ms: taken for noise
  // At the fixed rate, skipped: a clock that jumps ahead requests more than one detection for each
  // 8 bytes, in which there is no wand.
  uint64_t beyond_data = 0;

  BlinkWandCounts& operator+=(const BlinkWandCounts& other) {
    by_outcome += other.by_outcome;
    same_burst += other.same_burst;
    out_of_order += other.out_of_order;
    by_rise += other.by_rise;
    by_fall += other.by_fall;
    dense_triggers += other.dense_triggers;
    beyond_data += other.beyond_data;
    return *this;
  }
};

}  // namespace rigcal::agent
