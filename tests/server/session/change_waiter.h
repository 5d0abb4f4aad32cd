// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>

namespace rigcal::testing {

// Waits for changes that a notifier reports. A change that nobody waits for is remembered until the
// next Wait; several count as one.
class ChangeWaiter {
 public:
  std::function<void()> Wake() {
    return [this] {
      const std::lock_guard lock(mutex_);
      changed_ = true;
      condition_.notify_all();
    };
  }
  // False: none came in this time.
  bool Wait(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    const bool changed = condition_.wait_for(lock, time, [this] { return changed_; });
    changed_ = false;
    return changed;
  }

 private:
  std::mutex mutex_;
  std::condition_variable condition_;
  bool changed_ = false;
};

}  // namespace rigcal::testing
