// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/stream_key.h"
#include "server/store/delivery.h"

namespace rigcal::server {

using IngestCallback = std::function<void(absl::StatusOr<BatchAck>)>;

// Deliveries between the threads that submit them and the one that writes them, bounded by bytes.
// A delivery holds room from Reserve until the group that it was taken with is finished.
// Thread-safe; one thread takes.
class IngestQueue {
 public:
  // The deliveries of one commit.
  struct Group {
    std::vector<Delivery> deliveries;
    std::vector<IngestCallback> done;  // one per delivery
    size_t bytes = 0;
    std::vector<std::function<void()>> on_space;  // submitters that may try again
  };

  // Full at `limit_bytes`; a group has at most `group_limit_bytes`, or one delivery.
  IngestQueue(size_t limit_bytes, size_t group_limit_bytes)
      : limit_bytes_(limit_bytes), group_limit_bytes_(group_limit_bytes) {}

  // Holds room for a delivery that is being checked; Push or Release must follow.
  //   RESOURCE_EXHAUSTED  full; `on_space` is moved from, and given to a later Take when half of
  //                       the queue is free, or after Close
  //   UNAVAILABLE         closed
  absl::Status Reserve(size_t bytes, std::function<void()>& on_space);
  void Release(size_t bytes);
  // `reserved_bytes`: as given to Reserve; the delivery may have grown since.
  void Push(Delivery delivery, IngestCallback done, size_t reserved_bytes);

  // Waits for deliveries, or for room for submitters that wait; what it returns must be finished
  // before the next Take. An empty group: `timeout` has passed. None: closed, and all was taken.
  std::optional<Group> Take(std::optional<std::chrono::milliseconds> timeout = {});
  // Destroys what is left of the group, then gives back its room.
  void Finish(Group group);

  // Reserve fails from now on; what holds room can still be pushed and taken.
  void Close();
  // Returns when no delivery is being checked, queued or taken.
  void WaitIdle();
  size_t held_bytes() const;

 private:
  struct Entry {
    Delivery delivery;
    IngestCallback done;
    size_t bytes = 0;
  };
  // With mutex_ held.
  bool HasWork() const;

  const size_t limit_bytes_;
  const size_t group_limit_bytes_;
  mutable std::mutex mutex_;
  std::condition_variable work_;
  std::condition_variable idle_;
  std::deque<Entry> entries_;
  std::vector<std::function<void()>> on_space_;
  size_t held_bytes_ = 0;
  int reserved_ = 0;    // calls of Reserve that neither Push nor Release has followed
  bool taken_ = false;  // a group has been taken and not finished
  bool closed_ = false;
};

}  // namespace rigcal::server
