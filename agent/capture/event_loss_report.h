// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "agent/detect/event/blink_wand_counts.h"

namespace rigcal::agent {

// Says of a capture that events are missing: gaps in the stream, and blinks that the wand's pixels
// do not answer. Each is said once as soon as it is clear, and again at the end with all of it.
class EventLossReport {
 public:
  // What is to be said now, without the camera's name. `counts`: since the capture began.
  std::vector<std::string> Take(const BlinkWandCounts& counts, bool is_end);

 private:
  // As said last; 0: not yet.
  uint64_t said_gaps_ = 0, said_missing_ = 0;
};

}  // namespace rigcal::agent
