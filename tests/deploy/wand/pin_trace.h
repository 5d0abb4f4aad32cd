// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

namespace rigcal::testing {

// A change of a pin's level.
struct PinChange {
  double time_s = 0;
  bool high = false;

  friend bool operator==(const PinChange&, const PinChange&) = default;
};
using PinTrace = std::vector<PinChange>;  // ascending times; levels alternate

// A periodic signal, measured from its first rise to its last one. All NaN, and `rises` their
// number, if there are fewer than three.
struct PinSignal {
  int rises = 0;
  double first_rise_s = 0;
  double hz = 0;        // periods over time
  double jitter_s = 0;  // largest distance of a rise from its place in equal periods
  double duty = 0;      // share of the time in which the pin is high
  // Shortest and longest time for which it is high.
  double shortest_high_s = 0, longest_high_s = 0;
};
PinSignal MeasureSignal(const PinTrace& trace);

}  // namespace rigcal::testing
