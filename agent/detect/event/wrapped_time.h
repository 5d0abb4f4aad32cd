// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

namespace rigcal::agent {

// Microseconds from one time to another of which the lower 32 bits are known; the nearer way round.
inline double SinceUs(double from_us, double to_us) {
  constexpr double kWrapUs = 4294967296.0;
  return std::remainder(to_us - from_us, kWrapUs);
}

// The lower 32 bits of a time, which may be negative.
inline uint32_t WrappedUs(double time_us) {
  return static_cast<uint32_t>(static_cast<int64_t>(std::llround(time_us)));
}

}  // namespace rigcal::agent
