// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "common/time/clock.h"

namespace rigcal::agent {

// The difference between the server's UTC and this PC's, from a ping sent at `ping_monotonic_ns`
// whose answer, sent at `server_utc_ns`, has just arrived. The answer is assumed to have been sent
// half-way, so the error is at most half the round trip.
inline HostAlignment AlignHost(int64_t ping_monotonic_ns, int64_t server_utc_ns,
                               int64_t monotonic_now_ns, int64_t utc_now_ns) {
  const int64_t half_ns = std::max<int64_t>(0, monotonic_now_ns - ping_monotonic_ns) / 2;
  // Half a round trip of 0 still is not exact.
  const auto uncertainty_ns = std::clamp<int64_t>(half_ns, 1, std::numeric_limits<uint32_t>::max());
  return {.host_monotonic_ns = ping_monotonic_ns + half_ns,
          .server_minus_host_ns = server_utc_ns - (utc_now_ns - half_ns),
          .uncertainty_ns = static_cast<uint32_t>(uncertainty_ns)};
}

}  // namespace rigcal::agent
