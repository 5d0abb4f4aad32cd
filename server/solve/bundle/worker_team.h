// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace rigcal::server {

// A few threads that share out numbered tasks. Which thread runs which task is left open, so tasks
// must write to places of their own; whoever needs a sum adds them up in their order afterwards.
class WorkerTeam {
 public:
  // The calling thread is one of `thread_count` (at least 1).
  explicit WorkerTeam(int thread_count);
  ~WorkerTeam();
  WorkerTeam(const WorkerTeam&) = delete;
  WorkerTeam& operator=(const WorkerTeam&) = delete;

  int thread_count() const { return static_cast<int>(threads_.size()) + 1; }

  // Runs task(0) to task(count - 1) and returns when all have ended. `task` must not throw.
  void Run(int count, const std::function<void(int)>& task);

 private:
  void Work();
  void TakeTasks();

  std::vector<std::thread> threads_;
  std::mutex mutex_;
  std::condition_variable begin_, end_;
  uint64_t round_ = 0;
  int working_ = 0;
  bool ending_ = false;
  const std::function<void(int)>* task_ = nullptr;
  int count_ = 0;
  std::atomic<int> next_ = 0;
};

}  // namespace rigcal::server
