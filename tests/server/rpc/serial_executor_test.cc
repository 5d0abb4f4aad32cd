// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/serial_executor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace rigcal::testing::serial_executor_test {
namespace {

using server::SerialExecutor;

TEST(SerialExecutor, RunsInOrderAndFinishesWhatIsQueued) {
  std::vector<int> order;
  SerialExecutor executor;
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(executor.Run([&order, i] { order.push_back(i); }));
  executor.Shutdown();
  ASSERT_EQ(order.size(), 100u);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
  EXPECT_FALSE(executor.Run([] {}));
}

TEST(SerialExecutor, SurvivesAJobThatThrows) {
  std::atomic<bool> ran = false;
  SerialExecutor executor;
  executor.Run([] { throw std::runtime_error("a fault"); });
  executor.Run([&] { ran = true; });
  executor.Shutdown();
  EXPECT_TRUE(ran);
}

TEST(SerialExecutor, RunsOneAtATimeForManyCallers) {
  std::atomic<int> inside = 0;
  std::atomic<int> total = 0;
  std::atomic<bool> overlapped = false;
  SerialExecutor executor;
  std::vector<std::thread> callers;
  for (int t = 0; t < 4; ++t) {
    callers.emplace_back([&] {
      for (int i = 0; i < 100; ++i) {
        executor.Run([&] {
          if (++inside != 1) overlapped = true;
          ++total;
          --inside;
        });
      }
    });
  }
  for (std::thread& caller : callers) caller.join();
  executor.Shutdown();
  EXPECT_EQ(total, 400);
  EXPECT_FALSE(overlapped);
}

}  // namespace
}  // namespace rigcal::testing::serial_executor_test
