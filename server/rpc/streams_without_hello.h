// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <utility>

namespace rigcal::server {

// Agent streams that have not said who they are. They have places of their own, so that they cannot
// take those of agents; of more, the oldest is cut. Thread-safe.
class StreamsWithoutHello {
 public:
  explicit StreamsWithoutHello(size_t limit) : limit_(limit) {}

  // `cut` is called with no lock held, at most once.
  uint64_t Add(std::function<void()> cut) {
    std::function<void()> oldest;
    uint64_t ticket = 0;
    {
      std::lock_guard lock(mutex_);
      if (streams_.size() >= limit_ && !streams_.empty()) {
        oldest = std::move(streams_.begin()->second);
        streams_.erase(streams_.begin());
      }
      ticket = ++last_ticket_;
      streams_.emplace(ticket, std::move(cut));
    }
    if (oldest) oldest();
    return ticket;
  }
  void Remove(uint64_t ticket) {
    std::lock_guard lock(mutex_);
    streams_.erase(ticket);
  }
  size_t size() const {
    std::lock_guard lock(mutex_);
    return streams_.size();
  }

 private:
  const size_t limit_;
  mutable std::mutex mutex_;
  std::map<uint64_t, std::function<void()>> streams_;
  uint64_t last_ticket_ = 0;
};

}  // namespace rigcal::server
