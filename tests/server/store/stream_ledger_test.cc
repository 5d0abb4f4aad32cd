// SPDX-License-Identifier: Apache-2.0
#include "server/store/stream_ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cstdlib>
#include <set>
#include <utility>
#include <vector>

namespace rigcal::server::stream_ledger_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// One seed unless RC_PARAMS asks for another; rapidcheck prints how to repeat a failure.
[[maybe_unused]] const int kSeedIsSet = setenv("RC_PARAMS", "seed=20 max_success=300", 0);

TEST(StreamLedger, GivesAllOfARangeBeforeAnythingIsStored) {
  const StreamLedger ledger;
  EXPECT_EQ(ledger.durable_seq(), 0u);
  EXPECT_THAT(ledger.Missing({5, 9}), ElementsAre(SeqRange{5, 9}));
}

TEST(StreamLedger, JoinsEarlyRangesOnceTheGapIsFilled) {
  StreamLedger ledger;
  ledger.Add({5, 9});
  ledger.Add({12, 14});
  EXPECT_EQ(ledger.durable_seq(), 0u);
  ledger.Add({1, 5});
  EXPECT_EQ(ledger.durable_seq(), 8u);
  ledger.Add({9, 12});
  EXPECT_EQ(ledger.durable_seq(), 13u);
  EXPECT_EQ(ledger.early_range_count(), 0u);
}

TEST(StreamLedger, CutsARangeAtEverythingStored) {
  StreamLedger ledger(2);
  ledger.Add({5, 7});
  ledger.Add({9, 10});
  EXPECT_THAT(ledger.Missing({1, 12}),
              ElementsAre(SeqRange{3, 5}, SeqRange{7, 9}, SeqRange{10, 12}));
  EXPECT_THAT(ledger.Missing({6, 10}), ElementsAre(SeqRange{7, 9}));
  EXPECT_THAT(ledger.Missing({5, 7}), IsEmpty());
  EXPECT_THAT(ledger.Missing({1, 3}), IsEmpty());
}

TEST(StreamLedger, KeepsOneRangeWhileARecordingArrivesBackwards) {
  StreamLedger ledger;
  for (uint32_t seq = 1000; seq >= 2; --seq) {
    ledger.Add({seq, seq + 1});
    ASSERT_EQ(ledger.early_range_count(), 1u);
  }
  ledger.Add({1, 2});
  EXPECT_EQ(ledger.durable_seq(), 1000u);
}

TEST(StreamLedger, ReachesTheLastNumber) {
  StreamLedger ledger(kMaxSeq - 2);
  EXPECT_THAT(ledger.Missing({kMaxSeq - 4, kMaxSeq + 1}),
              ElementsAre(SeqRange{kMaxSeq - 1, kMaxSeq + 1}));
  ledger.Add({kMaxSeq - 1, kMaxSeq + 1});
  EXPECT_EQ(ledger.durable_seq(), kMaxSeq);
  EXPECT_THAT(ledger.Missing({1, kMaxSeq + 1}), IsEmpty());
}

TEST(StreamLedger, AgreesWithASetOfNumbers) {
  EXPECT_TRUE(rc::check([] {
    const auto ranges = *rc::gen::container<std::vector<std::pair<uint32_t, uint32_t>>>(
        rc::gen::pair(rc::gen::inRange(1u, 60u), rc::gen::inRange(0u, 12u)));
    StreamLedger ledger;
    std::set<uint32_t> model;
    for (const auto& [first, count] : ranges) {
      std::vector<uint32_t> expected;
      for (uint32_t seq = first; seq < first + count; ++seq) {
        if (model.insert(seq).second) expected.push_back(seq);
      }
      std::vector<uint32_t> missing;
      for (const SeqRange& range : ledger.Missing({first, first + count})) {
        RC_ASSERT(range.first < range.end);
        for (uint32_t seq = range.first; seq < range.end; ++seq) missing.push_back(seq);
      }
      RC_ASSERT(missing == expected);
      ledger.Add({first, first + count});
      uint32_t durable = 0;
      while (model.count(durable + 1) > 0) ++durable;
      RC_ASSERT(ledger.durable_seq() == durable);
    }
  }));
}

}  // namespace
}  // namespace rigcal::server::stream_ledger_test
