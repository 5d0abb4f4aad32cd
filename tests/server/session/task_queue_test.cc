// SPDX-License-Identifier: Apache-2.0
#include "server/session/task_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace rigcal::server::task_queue_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class TaskQueueTest : public ::testing::Test {
 protected:
  TaskQueue::Task Add(std::string word) {
    return [this, word] {
      const std::lock_guard lock(mutex_);
      words_.push_back(word);
    };
  }
  std::vector<std::string> words() {
    const std::lock_guard lock(mutex_);
    return words_;
  }

  std::mutex mutex_;
  std::vector<std::string> words_;
  TaskQueue queue_{"test"};
};

TEST_F(TaskQueueTest, RunsTasksInOrderAlsoThoseFromBeforeItsStart) {
  queue_.Post(Add("one"));
  queue_.Post([this] {
    Add("two")();
    queue_.Post(Add("four"));
  });
  queue_.Post(Add("three"));
  EXPECT_THAT(words(), IsEmpty());
  queue_.Start();
  queue_.WaitIdle();
  EXPECT_THAT(words(), ElementsAre("one", "two", "three", "four"));
}

TEST_F(TaskQueueTest, RunsLaterTasksWhenTheyAreDueAndDoesNotAwaitThem) {
  const auto now = std::chrono::steady_clock::now();
  std::promise<void> ran;
  queue_.PostAt(now + std::chrono::hours(1), Add("never"));
  queue_.PostAt(now + std::chrono::milliseconds(2), [&ran] { ran.set_value(); });
  queue_.PostAt(now + std::chrono::milliseconds(1), Add("first"));
  queue_.Start();
  queue_.WaitIdle();
  ran.get_future().wait();
  queue_.WaitIdle();
  EXPECT_THAT(words(), ElementsAre("first"));
}

TEST_F(TaskQueueTest, GoesOnAfterAnException) {
  queue_.Post([] { throw std::runtime_error("bad luck"); });
  queue_.Post(Add("next"));
  queue_.Start();
  queue_.WaitIdle();
  EXPECT_THAT(words(), ElementsAre("next"));
}

TEST_F(TaskQueueTest, DropsWhatWaitsAtShutdown) {
  std::promise<void> begun;
  std::promise<void> may_end;
  queue_.Post([&] {
    begun.set_value();
    may_end.get_future().wait();
    Add("running")();
  });
  queue_.Post(Add("waiting"));
  queue_.Start();
  begun.get_future().wait();
  std::thread shutdown([this] { queue_.Shutdown(); });
  queue_.WaitIdle();  // returns at the shutdown
  may_end.set_value();
  shutdown.join();
  EXPECT_THAT(words(), ElementsAre("running"));
  queue_.Start();
  queue_.WaitIdle();
  EXPECT_THAT(words(), ElementsAre("running"));
}

// The last reference a task holds may call the queue.
TEST_F(TaskQueueTest, DestroysTasksOutsideOfItsLock) {
  auto probe = std::shared_ptr<int>(new int(0), [this](const int* value) {
    queue_.Post(Add("destroyed"));
    delete value;
  });
  queue_.Post([held = std::move(probe)] {});
  queue_.Start();
  while (words().empty()) std::this_thread::yield();
  EXPECT_THAT(words(), ElementsAre("destroyed"));
}

}  // namespace
}  // namespace rigcal::server::task_queue_test
