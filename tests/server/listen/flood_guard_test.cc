// SPDX-License-Identifier: Apache-2.0
#include "server/listen/flood_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rigcal::testing::flood_guard_test {
namespace {

using server::ConnectionTraffic;
using server::FloodGuard;
using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr uint64_t kMb = 1'000'000;

class FloodGuardTest : public ::testing::Test {
 protected:
  FloodGuardTest() { open_ = {{.id = 1}, {.id = 2}}; }
  ConnectionTraffic& first() { return open_[0]; }
  ConnectionTraffic& second() { return open_[1]; }
  std::vector<FloodGuard::Cut> Look(milliseconds later = milliseconds(50)) {
    now_ += later;
    return guard_.Look(open_, memory_, now_);
  }

  FloodGuard guard_;
  std::vector<ConnectionTraffic> open_;
  uint64_t memory_ = 50 * kMb;
  FloodGuard::Clock::time_point now_ = FloodGuard::Clock::time_point(std::chrono::hours(1));
};

TEST_F(FloodGuardTest, MessagesAndTheirFramesAreNoFlood) {
  for (int i = 0; i < 10'000; ++i) {
    first().received_bytes += 1'040'000;
    first().explained_bytes += kMb;
    ASSERT_THAT(Look(), IsEmpty());
  }
}

TEST_F(FloodGuardTest, AMessageIsExplainedOnceItIsWhole) {
  for (int i = 0; i < 100; ++i) {
    for (int part = 0; part < 4; ++part) {
      first().received_bytes += kMb;
      ASSERT_THAT(Look(), IsEmpty());
    }
    first().explained_bytes += 4 * kMb;
    ASSERT_THAT(Look(), IsEmpty());
    EXPECT_FALSE(guard_.has_suspect());
  }
}

TEST_F(FloodGuardTest, AHeaderThatIsCopiedAgainAndAgainIsOne) {
  first().received_bytes = kMb;
  first().waiting_bytes = second().waiting_bytes = 50'000;
  second().received_bytes = 200'000;  // too little to keep anybody busy
  std::vector<FloodGuard::Cut> cuts;
  for (int i = 0; i < 12 && cuts.empty(); ++i) {
    first().received_bytes += 20'000;
    cuts = Look();
  }
  EXPECT_THAT(cuts, ElementsAre(AllOf(Field(&FloodGuard::Cut::id, 1),
                                      Field(&FloodGuard::Cut::why, HasSubstr("busy")))));
}

TEST_F(FloodGuardTest, ALargeMessageThatIsReadAsItComesIsNone) {
  first().waiting_bytes = 50'000;
  for (int i = 0; i < 50; ++i) {
    first().received_bytes += 100'000;
    ASSERT_THAT(Look(), IsEmpty());
  }
  // A slow line: nothing waits.
  first().waiting_bytes = 0;
  for (int i = 0; i < 50; ++i) {
    first().received_bytes += 1'000;
    ASSERT_THAT(Look(), IsEmpty());
  }
}

TEST_F(FloodGuardTest, WhatNoCallAccountsForIsOne) {
  first().received_bytes = 6 * kMb;
  second().received_bytes = second().explained_bytes = 8 * kMb;
  EXPECT_THAT(Look(), IsEmpty());
  first().received_bytes += kMb;
  EXPECT_THAT(Look(), ElementsAre(AllOf(Field(&FloodGuard::Cut::id, 1),
                                        Field(&FloodGuard::Cut::why, HasSubstr("7.0 MB")))));
}

TEST_F(FloodGuardTest, KeepaliveOfAYearIsNone) {
  for (int day = 0; day < 365; ++day) {
    first().received_bytes += 24 * 360 * 78;  // a PING and an answer each 10 s, with TLS
    ASSERT_THAT(Look(std::chrono::hours(24)), IsEmpty());
  }
}

TEST_F(FloodGuardTest, AcknowledgementsOfWhatIsSentAreNone) {
  for (int i = 0; i < 1'000; ++i) {
    first().sent_bytes += 100 * kMb;
    first().received_bytes += 100 * kMb / 4096 * 35;
    ASSERT_THAT(Look(), IsEmpty());
  }
}

TEST_F(FloodGuardTest, TheSuspectGoesThatLetsMemoryGrow) {
  EXPECT_THAT(Look(), IsEmpty());
  first().received_bytes += kMb;
  second().received_bytes += 20 * kMb;
  second().explained_bytes += 18 * kMb;  // more of it is unexplained, but hardly a tenth
  memory_ += 90 * kMb;
  EXPECT_THAT(Look(), IsEmpty());
  EXPECT_TRUE(guard_.has_suspect());
  memory_ += 20 * kMb;
  EXPECT_THAT(Look(), ElementsAre(AllOf(Field(&FloodGuard::Cut::id, 1),
                                        Field(&FloodGuard::Cut::why, HasSubstr("110 MB")))));
}

TEST_F(FloodGuardTest, MemoryThatGrowsWithoutASuspectCutsNobody) {
  for (int i = 0; i < 100; ++i) {
    memory_ += 20 * kMb;
    first().received_bytes = first().explained_bytes += 20 * kMb;
    ASSERT_THAT(Look(), IsEmpty());
  }
}

TEST_F(FloodGuardTest, MuchMemoryCutsWhoeverHasMostUnexplained) {
  EXPECT_THAT(Look(), IsEmpty());
  first().received_bytes += 50'000;
  second().received_bytes += 10 * kMb;
  second().explained_bytes += 9 * kMb;
  memory_ += 300 * kMb;
  EXPECT_THAT(Look(), ElementsAre(Field(&FloodGuard::Cut::id, 2)));
}

// Hundreds of agents that send at once to a server that is busy.
TEST_F(FloodGuardTest, MemoryThatFlowControlHasOfferedIsNoFlood) {
  EXPECT_THAT(Look(), IsEmpty());
  for (uint64_t id = 3; id <= 1'000; ++id) open_.push_back({.id = id});
  for (ConnectionTraffic& traffic : open_) traffic.received_bytes += 100'000;
  memory_ += 190 * kMb;  // of which 100 MB are theirs
  EXPECT_THAT(Look(), IsEmpty());
  memory_ += 20 * kMb;
  EXPECT_THAT(Look(), SizeIs(1));
}

TEST_F(FloodGuardTest, MoreThanAWindowIsNotOffered) {
  EXPECT_THAT(Look(), IsEmpty());
  first().received_bytes += 5 * kMb;
  memory_ += 100 * kMb;
  EXPECT_THAT(Look(), IsEmpty());
  memory_ += kMb;
  EXPECT_THAT(Look(), ElementsAre(Field(&FloodGuard::Cut::id, 1)));
}

TEST_F(FloodGuardTest, ANewConnectionBeginsAnew) {
  first().received_bytes = 6 * kMb;
  EXPECT_THAT(Look(), IsEmpty());
  first().id = 3;
  first().received_bytes = 5 * kMb;
  EXPECT_THAT(Look(), IsEmpty());
}

}  // namespace
}  // namespace rigcal::testing::flood_guard_test
