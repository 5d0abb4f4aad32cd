// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/target/detection_outcome.h"

namespace rigcal::agent {

// Of a BlinkWandDetector, since Create.
struct BlinkWandCounts {
  DetectionCounts by_outcome;  // one for each answer
  // Asked at the fixed rate again before every marker has had a new burst: not answered again.
  uint64_t same_burst = 0;
  uint64_t out_of_order = 0;    // an answer older than the last one, left out
  uint64_t dense_triggers = 0;  // closer together than 0.4 ms: taken for noise
  // Of the fixed rate, not answered: a clock that jumps ahead asks for more than one answer for
  // each 8 bytes, in which there is no wand.
  uint64_t beyond_data = 0;
};

}  // namespace rigcal::agent
