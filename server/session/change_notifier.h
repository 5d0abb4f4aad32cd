// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::server {

// Wakes the watchers of a resource when it changes. Thread-safe.
class ChangeNotifier {
 public:
  // One watcher, until it is destroyed. Must not outlive its notifier.
  class Watch {
   public:
    // Afterwards `wake` is not running and is not called again.
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

   private:
    friend class ChangeNotifier;
    Watch(ChangeNotifier* notifier, std::string_view id, std::function<void()> wake)
        : notifier_(notifier), id_(id), wake_(std::move(wake)) {}

    ChangeNotifier* const notifier_;
    const std::string id_;
    const std::function<void()> wake_;
    std::list<Watch*>::iterator place_;
  };

  explicit ChangeNotifier(size_t max_watches) : max_watches_(max_watches) {}

  // Calls `wake` for each change of `id`, on the thread that reports it and under the notifier's
  // lock: it only notes the change, and neither blocks nor calls the notifier.
  // RESOURCE_EXHAUSTED: the limit of watchers is reached.
  absl::StatusOr<std::unique_ptr<Watch>> Add(std::string_view id, std::function<void()> wake);
  void Notify(std::string_view id);

 private:
  const size_t max_watches_;
  std::mutex mutex_;
  std::list<Watch*> watches_;
};

}  // namespace rigcal::server
