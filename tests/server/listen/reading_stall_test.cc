// SPDX-License-Identifier: Apache-2.0
#include "server/listen/reading_stall.h"

#include <gtest/gtest.h>

namespace rigcal::testing::reading_stall_test {
namespace {

using server::ConnectionTraffic;
using server::ReadingStall;

class ReadingStallTest : public ::testing::Test {
 protected:
  ReadingStallTest() {
    for (uint64_t id = 1; id <= 5; ++id) open_.push_back({.id = id, .received_bytes = 1'000});
  }
  void Read(size_t connection) { open_[connection].received_bytes += 100'000; }
  void Wait(size_t connection) { open_[connection].waiting_bytes = 50; }

  ReadingStall stall_{2};
  std::vector<ConnectionTraffic> open_;
};

TEST_F(ReadingStallTest, FindsOneThatWaitsWhileAllReadersAreHeld) {
  EXPECT_FALSE(stall_.Look(open_));
  Read(0);
  Read(1);
  Wait(4);
  EXPECT_FALSE(stall_.Look(open_)) << "it may have begun to wait just now";
  Read(0);
  Read(1);
  EXPECT_TRUE(stall_.Look(open_));
  Read(0);
  Read(1);
  Read(4);
  EXPECT_FALSE(stall_.Look(open_));
}

TEST_F(ReadingStallTest, FindsOneThatWaitsWhileNothingIsRead) {
  Wait(4);
  EXPECT_FALSE(stall_.Look(open_));
  EXPECT_TRUE(stall_.Look(open_));
}

TEST_F(ReadingStallTest, ManyThatAreReadAreNoStall) {
  Wait(4);
  stall_.Look(open_);
  for (const size_t connection : {0, 1, 2}) Read(connection);
  EXPECT_FALSE(stall_.Look(open_));
}

TEST_F(ReadingStallTest, OneThatWaitsAgainHasNotWaitedSinceTheLastLook) {
  Wait(4);
  stall_.Look(open_);
  Read(4);
  EXPECT_FALSE(stall_.Look(open_));
  EXPECT_TRUE(stall_.Look(open_));
}

TEST_F(ReadingStallTest, AnotherConnectionIsAnotherOne) {
  Wait(4);
  stall_.Look(open_);
  open_[4].id = 6;
  open_[4].received_bytes = 0;
  EXPECT_FALSE(stall_.Look(open_));
}

}  // namespace
}  // namespace rigcal::testing::reading_stall_test
