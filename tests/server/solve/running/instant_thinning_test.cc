// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/instant_thinning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::server::instant_thinning_test {
namespace {

constexpr int64_t kPeriodNs = 20'000'000;
constexpr int64_t kBeginNs = 7'000'000'000;

// Instants every 20 ms, of so many cameras.
InstantList Every20Ms(int count, size_t cameras) {
  InstantList list;
  for (int i = 0; i < count; ++i) {
    Instant instant;
    instant.rig_time_ns = kBeginNs + i * kPeriodNs;
    instant.members.resize(cameras);
    list.instants.push_back(instant);
  }
  return list;
}

int CountChosen(const InstantThinning& thinning, const InstantList& list, int64_t one_of = 1) {
  int chosen = 0;
  for (const Instant& instant : list.instants) {
    chosen += thinning.IsChosen(instant.rig_time_ns, one_of);
  }
  return chosen;
}

TEST(InstantThinning, ChoosesAboutSoManyViewsEvenly) {
  const InstantList list = Every20Ms(1000, 4);
  const InstantThinning thinning(list, 400);
  EXPECT_EQ(thinning.instant_count(), 1000);
  EXPECT_EQ(thinning.origin_ns(), kBeginNs);
  EXPECT_EQ(CountChosen(thinning, list), 100);
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(thinning.IsChosen(kBeginNs + i * kPeriodNs), i % 10 == 0) << i;
  }
  // Of those, every fifth.
  EXPECT_EQ(CountChosen(thinning, list, 5), 20);
}

TEST(InstantThinning, ChoosesAllOfFew) {
  const InstantList list = Every20Ms(50, 4);
  EXPECT_EQ(CountChosen(InstantThinning(list, 4000), list), 50);
  EXPECT_EQ(CountChosen(InstantThinning(), list), 50);
  EXPECT_TRUE(InstantThinning(InstantList(), 4000).IsChosen(kBeginNs));
}

}  // namespace
}  // namespace rigcal::server::instant_thinning_test
