// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/host_alignment.h"

#include <algorithm>
#include <chrono>
#include <limits>

namespace rigcal::agent {

int64_t MonotonicNowNs() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int64_t UtcNowNs() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

HostAlignment AlignHost(int64_t ping_monotonic_ns, int64_t server_utc_ns, int64_t monotonic_now_ns,
                        int64_t utc_now_ns) {
  const int64_t half_ns = std::max<int64_t>(0, monotonic_now_ns - ping_monotonic_ns) / 2;
  const int64_t host_utc_half_way_ns = utc_now_ns - half_ns;
  // Half a round trip of 0 still is not exact.
  const int64_t uncertainty_ns =
      std::clamp<int64_t>(half_ns, 1, std::numeric_limits<uint32_t>::max());
  return {.host_monotonic_ns = ping_monotonic_ns + half_ns,
          .server_minus_host_ns = server_utc_ns - host_utc_half_way_ns,
          .uncertainty_ns = static_cast<uint32_t>(uncertainty_ns)};
}

}  // namespace rigcal::agent
