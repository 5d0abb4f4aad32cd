// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/simulation/frames/sent_code.h"

namespace rigcal {

// A short part of an exposure in which a sphere hardly moves.
struct ExposurePart {
  double dt_s = 0;       // its middle, from the middle of the exposure
  double share = 0;      // of the exposure
  double lit_share = 0;  // of the exposure, during which the LED is on; at most `share`
};

struct BlinkTiming {
  double hz = 0;  // 0: on all the time
  double duty = 0.5;
  double phase_s = 0;  // time on the LED's oscillator at mid exposure; on during [0, duty) of each
                       // period
  SentCode code;       // by the same oscillator
};

// Cuts an exposure at each switching of the LED, then so fine that no part is longer than
// `longest_part_s`; exact in the LED's time on. Where the whole exposure is no longer than
// `longest_part_s` it is one part, whose dt_s is the mean time of the light.
std::vector<ExposurePart> PlanExposure(double exposure_s, const BlinkTiming& blink,
                                       double longest_part_s);

}  // namespace rigcal
