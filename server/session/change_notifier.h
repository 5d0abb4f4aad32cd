// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::server {

// Wakes those who watch a resource when it changes. A change that nobody waits for is remembered
// until the next Wait, so none is missed; several changes count as one. Thread-safe.
class ChangeNotifier {
 public:
  enum class Event { kChanged, kTimeout, kShutdown };

  // One watcher; it begins with a change, so that the first Wait returns at once. Must not outlive
  // its notifier.
  class Watch {
   public:
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

    Event Wait(std::chrono::milliseconds timeout);
    // Waits for the time to pass, however much changes meanwhile. False: shut down.
    bool Pause(std::chrono::milliseconds time);

   private:
    friend class ChangeNotifier;
    explicit Watch(ChangeNotifier* notifier, std::string_view id) : notifier_(notifier), id_(id) {}

    ChangeNotifier* const notifier_;
    const std::string id_;
    bool changed_ = true;
    std::condition_variable condition_;
    std::list<Watch*>::iterator place_;
  };

  explicit ChangeNotifier(size_t max_watches) : max_watches_(max_watches) {}

  // RESOURCE_EXHAUSTED: as many as allowed are watching. UNAVAILABLE: after Shutdown.
  absl::StatusOr<std::unique_ptr<Watch>> Add(std::string_view id);
  void Notify(std::string_view id);
  // Every Wait returns kShutdown from now on.
  void Shutdown();

 private:
  const size_t max_watches_;
  std::mutex mutex_;
  std::list<Watch*> watches_;
  bool shutdown_ = false;
};

}  // namespace rigcal::server
