// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "common/time/clock.h"

namespace rigcal::agent {

int64_t MonotonicNowNs();  // CLOCK_MONOTONIC
int64_t UtcNowNs();        // since 1970

// The difference between the server's UTC and this PC's, from a ping sent at `ping_monotonic_ns`
// whose answer, sent at `server_utc_ns`, has just arrived. The answer is assumed to have been sent
// half-way, so the error is at most half the round trip.
HostAlignment AlignHost(int64_t ping_monotonic_ns, int64_t server_utc_ns, int64_t monotonic_now_ns,
                        int64_t utc_now_ns);

}  // namespace rigcal::agent
