// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace rigcal {

// A part of a stretch of time during which an LED does not switch.
struct LightStep {
  double end_us = 0;  // since the stretch began
  bool lit = false;
};

// An LED that shines during the first `duty` of each of its periods.
struct BlinkingLed {
  double hz = 0;     // 0: it shines all the time
  double duty = 1;   // (0, 1]
  double phase = 0;  // where in its period it is at time 0, 0 to 1

  bool IsLit(double time_s) const;
  // A stretch from switch to switch; replaces `steps`, which are never none.
  void StepsOf(double begin_us, double duration_us, std::vector<LightStep>* steps) const;
};

}  // namespace rigcal
