// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace rigcal::server {

// Runs jobs one after the other on a thread of its own: for what a stream's reactor must not wait
// for. Callers bound the number of jobs (here: two per open agent stream). Thread-safe.
class SerialExecutor {
 public:
  SerialExecutor();
  ~SerialExecutor();

  // False, and the job is dropped, after Shutdown.
  bool Run(std::function<void()> job);
  // Runs what is queued, then ends the thread.
  void Shutdown();

 private:
  void Loop();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> jobs_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace rigcal::server
