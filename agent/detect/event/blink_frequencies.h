// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/target/target.h"

namespace rigcal::agent {

// The distinct blink frequencies of a target, ascending, and which of them each marker has.
struct BlinkFrequencies {
  std::vector<double> hz;
  std::vector<int> of_marker;
};

// Frequencies up to this ratio apart count as one, their mean: oscillators that should be equal.
inline constexpr double kSameBlinkRatio = 1.02;

// The target must be valid; `default_hz` is for one without frequencies.
BlinkFrequencies BlinkFrequenciesOf(const Target& target, double default_hz);

}  // namespace rigcal::agent
