// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace rigcal::agent {

// Microseconds from one time to another of which the lower 32 bits are known; the nearer way round.
inline double SinceUs(double from_us, double to_us) {
  constexpr double kWrapUs = 4294967296.0;
  return std::remainder(to_us - from_us, kWrapUs);
}

}  // namespace rigcal::agent
