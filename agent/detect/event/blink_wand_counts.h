// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/target/detection_outcome.h"

namespace rigcal::agent {

// Counts of a BlinkWandDetector since Create.
struct BlinkWandCounts {
  DetectionCounts by_outcome = {};  // one for each detection
  // At the fixed rate, before every marker had a new burst: not emitted again.
  uint64_t same_burst = 0;
  uint64_t out_of_order = 0;  // older than the last one emitted, left out
  // Wands by pixels that answer only the rise, or only the fall, of the light (PixelAnswers).
  uint64_t by_rise = 0, by_fall = 0;
  uint64_t events = 0, time_us = 0;  // of the stream; silence of a scene that is off left out
  // Wands, the sum of the percentages of their pixels that answered a blink, and those of them of
  // which clearly less than all did (BlinkBlob::answered_share).
  uint64_t judged = 0, answered_percent = 0, thinned = 0;
  // Detections without a wand in which pixels blink as it does but miss blinks
  // (BlinkFilter::AnsweredShare), and the sum of the percentages that they answer.
  uint64_t missed_looks = 0, missed_answered_percent = 0;
  // Ambiguous detections in which a narrower band would leave the other lights out, and the sums of
  // these bands and of the other lights' frequencies, in 1/10000 and Hz.
  uint64_t banded = 0, band_10000 = 0, other_hz = 0;
  // Gaps in which the whole sensor is silent while the scene fires (EventGaps), their length, and
  // wands of which a marker's burst is in one.
  uint64_t gaps = 0, gap_us = 0, beside_gap = 0;
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
    events += other.events;
    time_us += other.time_us;
    judged += other.judged;
    answered_percent += other.answered_percent;
    thinned += other.thinned;
    missed_looks += other.missed_looks;
    missed_answered_percent += other.missed_answered_percent;
    banded += other.banded;
    band_10000 += other.band_10000;
    other_hz += other.other_hz;
    gaps += other.gaps;
    gap_us += other.gap_us;
    beside_gap += other.beside_gap;
    dense_triggers += other.dense_triggers;
    beyond_data += other.beyond_data;
    return *this;
  }
};

}  // namespace rigcal::agent
