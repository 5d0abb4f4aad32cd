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
    EXPECT_FALSE(Look());
  }
  void Read(size_t connection) { open_[connection].received_bytes += 100'000; }
  void Wait(size_t connection) { open_[connection].waiting_bytes = 50; }
  bool Look() {
    now_ += std::chrono::milliseconds(50);
    return stall_.Look(open_, now_);
  }

  ReadingStall stall_{2};
  std::vector<ConnectionTraffic> open_;
  ReadingStall::Clock::time_point now_{std::chrono::hours(1)};
};

TEST_F(ReadingStallTest, FindsOneThatWaitsWhileAllReadersAreHeld) {
  Wait(4);
  // It may have begun to wait just before the first look.
  for (int look = 0; look < 4; ++look) {
    Read(0);
    Read(1);
    EXPECT_FALSE(Look()) << look;
  }
  for (int look = 0; look < 3; ++look) {
    Read(0);
    Read(1);
    EXPECT_TRUE(Look()) << look;
  }
  Read(0);
  Read(1);
  Read(4);
  EXPECT_FALSE(Look());
}

TEST_F(ReadingStallTest, FindsOneThatWaitsWhileNothingIsRead) {
  Wait(4);
  for (int look = 0; look < 4; ++look) EXPECT_FALSE(Look()) << look;
  EXPECT_TRUE(Look());
}

TEST_F(ReadingStallTest, ManyThatAreReadAreNoStall) {
  Wait(4);
  for (int look = 0; look < 20; ++look) {
    for (const size_t connection : {0, 1, 2}) Read(connection);
    EXPECT_FALSE(Look()) << look;
  }
}

TEST_F(ReadingStallTest, AShortPauseIsNoStall) {
  for (const size_t connection : {0, 1, 2, 3, 4}) Wait(connection);
  for (int look = 0; look < 20; ++look) {
    if (look % 4 == 0) {
      for (const size_t connection : {0, 1, 2, 3, 4}) Read(connection);
    }
    EXPECT_FALSE(Look()) << look;
  }
}

TEST_F(ReadingStallTest, AnotherConnectionIsAnotherOne) {
  Wait(4);
  for (int look = 0; look < 20; ++look) {
    // Each is read and goes, and the next one waits in its place.
    ++open_[4].id;
    open_[4].received_bytes = 0;
    EXPECT_FALSE(Look()) << look;
  }
}

TEST_F(ReadingStallTest, ConnectionsThatWaitForNothingAreNoStall) {
  for (int look = 0; look < 20; ++look) EXPECT_FALSE(Look()) << look;
}

}  // namespace
}  // namespace rigcal::testing::reading_stall_test
