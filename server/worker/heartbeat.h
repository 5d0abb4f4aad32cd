// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pthread.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>

#include "absl/status/statusor.h"

namespace rigcal::server {

// How often a worker says that it works.
inline constexpr std::chrono::milliseconds kHeartbeatInterval{250};

// Calls `beat` from a thread of its own while the other threads of this process work: they must
// have had CPU time since the last look. So neither a stage that reports no progress is taken for a
// hang, nor a process that waits for something which never comes for one that works. A solve that
// goes in circles does have CPU time: that it gets nowhere shows in its progress alone.
class Heartbeat {
 public:
  // RESOURCE_EXHAUSTED: there can be no thread.
  static absl::StatusOr<std::unique_ptr<Heartbeat>> Start(
      std::function<void()> beat, std::chrono::milliseconds interval = kHeartbeatInterval);
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;
  // No call of `beat` comes after this.
  ~Heartbeat();

 private:
  Heartbeat(std::function<void()> beat, std::chrono::milliseconds interval)
      : beat_(std::move(beat)), interval_(interval) {}
  static void* Run(void* self);
  void Loop();

  const std::function<void()> beat_;
  const std::chrono::milliseconds interval_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;
  pthread_t thread_{};
};

}  // namespace rigcal::server
