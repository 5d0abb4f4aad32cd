// SPDX-License-Identifier: Apache-2.0
#include "agent/uplink/backoff.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace rigcal::agent::backoff_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(Backoff, SpreadsWaitsUpToACeilingThatDoubles) {
  Backoff::Duration largest[12] = {};
  Backoff::Duration smallest[12];
  std::fill(std::begin(smallest), std::end(smallest), seconds(1000));
  for (uint64_t seed = 0; seed < 300; ++seed) {
    Backoff backoff(milliseconds(200), seconds(30), seed);
    for (int attempt = 0; attempt < 12; ++attempt) {
      const Backoff::Duration wait = backoff.Next();
      largest[attempt] = std::max(largest[attempt], wait);
      smallest[attempt] = std::min(smallest[attempt], wait);
    }
  }
  for (int attempt = 0; attempt < 12; ++attempt) {
    const Backoff::Duration ceiling =
        std::min<Backoff::Duration>(milliseconds(200) * (1 << attempt), seconds(30));
    EXPECT_LE(largest[attempt], ceiling) << attempt;
    EXPECT_GE(largest[attempt], ceiling * 9 / 10) << attempt;
    EXPECT_GE(smallest[attempt], Backoff::Duration(0)) << attempt;
    EXPECT_LE(smallest[attempt], ceiling / 10) << attempt;
  }
}

TEST(Backoff, BeginsAnewAfterReset) {
  Backoff backoff(milliseconds(200), seconds(30), 1);
  for (int attempt = 0; attempt < 10'000; ++attempt) EXPECT_LE(backoff.Next(), seconds(30));
  for (int attempt = 0; attempt < 100; ++attempt) {
    backoff.Reset();
    EXPECT_LE(backoff.Next(), milliseconds(200));
  }
}

}  // namespace
}  // namespace rigcal::agent::backoff_test
