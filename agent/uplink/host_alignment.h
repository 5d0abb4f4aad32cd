// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/time/clock.h"

namespace rigcal::agent {

int64_t MonotonicNowNs();  // CLOCK_MONOTONIC
int64_t UtcNowNs();        // since 1970

// How far this PC's UTC is from the server's, from a ping sent at `ping_monotonic_ns` whose answer,
// given at `server_utc_ns`, is here now. The answer is taken to have been given half-way, so the
// truth lies within half the round trip.
HostAlignment AlignHost(int64_t ping_monotonic_ns, int64_t server_utc_ns, int64_t monotonic_now_ns,
                        int64_t utc_now_ns);

}  // namespace rigcal::agent
