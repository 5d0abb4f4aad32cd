// SPDX-License-Identifier: Apache-2.0
#include "server/worker/heartbeat.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "tests/testing/status_matchers.h"

namespace rigcal::server::heartbeat_test {
namespace {

using std::chrono::milliseconds;

TEST(Heartbeat, BeatsWhileAnotherThreadWorks) {
  std::atomic<int> beats = 0;
  ASSERT_OK_AND_ASSIGN(auto heartbeat, Heartbeat::Start([&beats] { ++beats; }, milliseconds(5)));
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (beats < 5 && std::chrono::steady_clock::now() < limit) {
  }
  EXPECT_GE(beats, 5);
  heartbeat.reset();
  const int last = beats;
  const auto later = std::chrono::steady_clock::now() + milliseconds(50);
  while (std::chrono::steady_clock::now() < later) {
  }
  EXPECT_EQ(beats, last);
}

// A process that waits for what does not come: its heartbeat alone does not count as work.
TEST(Heartbeat, IsSilentWhileEverybodyWaits) {
  std::atomic<int> beats = 0;
  ASSERT_OK_AND_ASSIGN(auto heartbeat, Heartbeat::Start([&beats] { ++beats; }, milliseconds(2)));
  std::mutex mutex;
  std::condition_variable never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, milliseconds(600), [] { return false; });
  // At the beginning and at the end something is done; 300 looks lie between.
  EXPECT_LT(beats, 20);
}

}  // namespace
}  // namespace rigcal::server::heartbeat_test
