// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/host_alignment.h"

#include <gtest/gtest.h>

#include <limits>

namespace rigcal::agent::host_alignment_test {
namespace {

constexpr int64_t kSecond = 1'000'000'000;

TEST(AlignHost, FindsTheServersClockAheadOfTheHosts) {
  // Sent at 100 s, back at 100.2 s; the server, 3 s ahead, answered half-way at host UTC 5000.1 s.
  const HostAlignment alignment =
      AlignHost(100 * kSecond, 5003 * kSecond + kSecond / 10, 100 * kSecond + kSecond / 5,
                5000 * kSecond + kSecond / 5);
  EXPECT_EQ(alignment.server_minus_host_ns, 3 * kSecond);
  EXPECT_EQ(alignment.host_monotonic_ns, 100 * kSecond + kSecond / 10);
  EXPECT_EQ(alignment.uncertainty_ns, kSecond / 10);
}

TEST(AlignHost, BoundsAnUnevenRoundTripByItsUncertainty) {
  // The answer was given at once, and took the whole 0.2 s back: the clocks are equal.
  const HostAlignment alignment =
      AlignHost(0, 5000 * kSecond, kSecond / 5, 5000 * kSecond + kSecond / 5);
  EXPECT_LE(std::abs(alignment.server_minus_host_ns), alignment.uncertainty_ns);
}

TEST(AlignHost, KeepsItsUncertaintyInRange) {
  EXPECT_EQ(AlignHost(7, 7, 7, 7).uncertainty_ns, 1u);
  EXPECT_EQ(AlignHost(0, 0, 3600 * kSecond, 0).uncertainty_ns,
            std::numeric_limits<uint32_t>::max());
}

}  // namespace
}  // namespace rigcal::agent::host_alignment_test
