// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/ingest_queue.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {

absl::Status IngestQueue::Reserve(size_t bytes, std::function<void()>& on_space) {
  const std::lock_guard lock(mutex_);
  if (closed_) return absl::UnavailableError("the server is shutting down; try again later");
  if (held_bytes_ >= limit_bytes_) {
    if (on_space) on_space_.push_back(std::move(on_space));
    return absl::ResourceExhaustedError(
        absl::StrCat("the server's queue is full (", held_bytes_, " bytes); try again later"));
  }
  held_bytes_ += bytes;
  ++reserved_;
  return absl::OkStatus();
}

void IngestQueue::Release(size_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    held_bytes_ -= bytes;
    --reserved_;
  }
  idle_.notify_all();
  work_.notify_one();  // this room, or the last reservation, may be waited for
}

void IngestQueue::Push(Delivery delivery, IngestCallback done, size_t reserved_bytes) {
  Entry entry{.delivery = std::move(delivery), .done = std::move(done)};
  entry.bytes = entry.delivery.Bytes();
  {
    const std::lock_guard lock(mutex_);
    held_bytes_ += entry.bytes - reserved_bytes;
    --reserved_;
    entries_.push_back(std::move(entry));
  }
  work_.notify_one();
}

bool IngestQueue::HasWork() const {
  const bool has_room = held_bytes_ <= limit_bytes_ / 2;
  return !entries_.empty() || (!on_space_.empty() && (has_room || closed_));
}

std::optional<IngestQueue::Group> IngestQueue::Take(
    std::optional<std::chrono::milliseconds> timeout) {
  const auto ready = [this] { return HasWork() || (closed_ && reserved_ == 0); };
  std::unique_lock lock(mutex_);
  if (!timeout) {
    work_.wait(lock, ready);
  } else if (!work_.wait_for(lock, *timeout, ready)) {
    return Group();
  }
  if (!HasWork()) return std::nullopt;
  Group group;
  // Not as soon as one byte is free: those who wait would come one by one, and wait again.
  if (held_bytes_ <= limit_bytes_ / 2 || closed_) group.on_space = std::exchange(on_space_, {});
  while (!entries_.empty()) {
    Entry& next = entries_.front();
    if (!group.deliveries.empty() && group.bytes + next.bytes > group_limit_bytes_) break;
    group.bytes += next.bytes;
    group.deliveries.push_back(std::move(next.delivery));
    group.done.push_back(std::move(next.done));
    entries_.pop_front();
  }
  taken_ = true;
  return group;
}

void IngestQueue::Finish(Group group) {
  const size_t bytes = group.bytes;
  // What callbacks hold must not be destroyed under the lock.
  group = Group();
  const std::lock_guard lock(mutex_);
  held_bytes_ -= bytes;
  taken_ = false;
  if (entries_.empty()) idle_.notify_all();
}

void IngestQueue::Close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  work_.notify_all();
}

void IngestQueue::WaitIdle() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return entries_.empty() && reserved_ == 0 && !taken_; });
}

size_t IngestQueue::held_bytes() const {
  const std::lock_guard lock(mutex_);
  return held_bytes_;
}

}  // namespace rigcal::server
