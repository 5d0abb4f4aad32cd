// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

namespace rigcal::server {

// Runs tasks one after the other on a thread of its own: those posted for now in their order, those
// for later when they are due. An exception of a task is logged, and the next one runs.
// Thread-safe; tasks may post.
class TaskQueue {
 public:
  using Task = std::function<void()>;
  using Time = std::chrono::steady_clock::time_point;

  // `name` begins messages in the log.
  explicit TaskQueue(const char* name) : name_(name) {}
  ~TaskQueue() { Shutdown(); }

  // Tasks may be posted before, and wait. Nothing happens the second time, or after Shutdown.
  void Start();
  // Lets the running task end; those that wait are dropped. Not from a task.
  void Shutdown();
  void Post(Task task);
  void PostAt(Time due, Task task);
  // Returns when no task runs or waits, except for tasks that are not due yet; or at Shutdown. The
  // thread must run.
  void WaitIdle();

 private:
  void Run();

  const char* const name_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable idle_;
  std::deque<Task> tasks_;
  std::multimap<Time, Task> later_;
  bool running_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace rigcal::server
