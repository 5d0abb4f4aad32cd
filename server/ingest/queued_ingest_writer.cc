// SPDX-License-Identifier: Apache-2.0
// The writer's side of QueuedIngest.
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <limits>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "server/ingest/queued_ingest.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kDiskFullCheckInterval{1};
// Less than this on the disk counts as full.
constexpr uint64_t kDiskHasRoomBytes = 16u << 20;

void AddUp(const AppendOutcome& outcome, AppendOutcome* total) {
  AppendOutcome sum = outcome;
  sum.stored_rows += total->stored_rows;
  sum.duplicate_rows += total->duplicate_rows;
  sum.refused_rows += total->refused_rows;
  *total = sum;
}

}  // namespace

void QueuedIngest::RunWriter() {
  std::unique_lock lock(mutex_);
  while (HasWork() || !stopping_ || validating_ > 0) {
    WaitForWork(lock);
    std::vector<std::function<void()>> space_waiters = TakeSpaceWaiters();
    Group group = TakeGroup();
    const size_t group_bytes = group.bytes;
    writing_ = true;
    lock.unlock();

    for (const auto& on_space : space_waiters) on_space();
    Write(group);
    // What callbacks hold must not be destroyed under the lock.
    space_waiters.clear();
    group = Group();

    lock.lock();
    held_bytes_ -= group_bytes;
    writing_ = false;
    if (queue_.empty()) idle_.notify_all();
  }
}

// Called with the lock held, as those below that have no lock of their own.
void QueuedIngest::WaitForWork(std::unique_lock<std::mutex>& lock) {
  const auto ready = [this] { return HasWork() || (stopping_ && validating_ == 0); };
  while (disk_full_ && !work_.wait_for(lock, kDiskFullCheckInterval, ready)) {
    lock.unlock();
    ForgetDiskFullWhenThereIsRoom();
    lock.lock();
  }
  work_.wait(lock, ready);
}

bool QueuedIngest::HasWork() const {
  const bool has_room = held_bytes_ <= options_.queue_limit_bytes / 2;
  return !queue_.empty() || (!space_waiters_.empty() && (has_room || stopping_));
}

std::vector<std::function<void()>> QueuedIngest::TakeSpaceWaiters() {
  // Not as soon as one byte is free: those who wait would come one by one, and wait again.
  if (held_bytes_ > options_.queue_limit_bytes / 2 && !stopping_) return {};
  return std::exchange(space_waiters_, {});
}

QueuedIngest::Group QueuedIngest::TakeGroup() {
  Group group;
  while (!queue_.empty()) {
    Entry& next = queue_.front();
    if (!group.entries.empty() && group.bytes + next.bytes > options_.group_limit_bytes) break;
    group.bytes += next.bytes;
    group.requests.push_back(std::move(next.request));
    group.entries.push_back(std::move(next));
    queue_.pop_front();
  }
  return group;
}

void QueuedIngest::Write(const Group& group) {
  if (group.entries.empty()) return;
  const absl::StatusOr<std::vector<AppendOutcome>> outcomes = Append(group);
  NoteResult(outcomes);
  if (!outcomes.ok()) {
    for (const Entry& entry : group.entries) entry.done(outcomes.status());
    return;
  }
  Answer(group, *outcomes);
  if (on_progress_) ReportProgress(group, *outcomes);
}

absl::StatusOr<std::vector<AppendOutcome>> QueuedIngest::Append(const Group& group) {
  {
    const std::lock_guard lock(mutex_);
    if (!failed_.ok()) return failed_;
  }
  try {
    absl::StatusOr<std::vector<AppendOutcome>> outcomes = store_->Append(group.requests);
    if (outcomes.ok() && outcomes->size() != group.requests.size()) {
      return absl::InternalError("the store has not answered every delivery");
    }
    return outcomes;
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("storing observations: ", error.what()));
  }
}

void QueuedIngest::NoteResult(const absl::StatusOr<std::vector<AppendOutcome>>& outcomes) {
  const std::lock_guard lock(mutex_);
  if (outcomes.ok()) {
    ++stats_.commit_count;
    for (const AppendOutcome& outcome : *outcomes) {
      stats_.stored_observation_count += outcome.stored_rows;
      stats_.duplicate_observation_count += outcome.duplicate_rows;
      stats_.refused_observation_count += outcome.refused_rows;
    }
    if (disk_full_) spdlog::info("ingest: the disk has room again");
    disk_full_ = false;
    stats_.problem.clear();
    return;
  }
  const absl::Status& status = outcomes.status();
  if (!failed_.ok()) return;
  if (absl::IsResourceExhausted(status)) {
    if (!disk_full_) spdlog::error("ingest: {}", std::string(status.message()));
    disk_full_ = true;
  } else if (absl::IsUnavailable(status)) {
    spdlog::warn("ingest: {}", std::string(status.message()));
  } else {
    // What has failed once for another reason than a full disk would most likely fail again, and
    // trying a failed sync again is how data gets lost.
    failed_ = absl::InternalError(
        absl::StrCat("observations are not stored any more: ", std::string(status.message())));
    spdlog::error("ingest: {}", std::string(failed_.message()));
    stats_.problem = std::string(failed_.message());
    return;
  }
  stats_.problem = std::string(status.message());
}

void QueuedIngest::Answer(const Group& group, const std::vector<AppendOutcome>& outcomes) const {
  for (size_t i = 0; i < group.entries.size(); ++i) {
    const Entry& entry = group.entries[i];
    const StreamKey& stream = group.requests[i].stream;
    const AppendOutcome& outcome = outcomes[i];
    if (outcome.unknown) {
      entry.done(
          absl::NotFoundError(absl::StrCat(StreamName(stream), ": there is none (any more)")));
      continue;
    }
    const uint64_t send_limit = uint64_t{outcome.durable_seq} + options_.send_window;
    BatchAck ack;
    ack.stream = stream;
    ack.durable_seq = outcome.durable_seq;
    ack.send_limit_seq =
        static_cast<uint32_t>(std::min<uint64_t>(send_limit, std::numeric_limits<uint32_t>::max()));
    ack.faults = entry.faults;
    ack.fault_count = entry.fault_count;
    ack.complete = outcome.complete;
    entry.done(std::move(ack));
  }
}

void QueuedIngest::ReportProgress(const Group& group,
                                  const std::vector<AppendOutcome>& outcomes) const {
  absl::flat_hash_map<StreamKey, AppendOutcome> by_stream;
  for (size_t i = 0; i < outcomes.size(); ++i) {
    if (!outcomes[i].unknown) AddUp(outcomes[i], &by_stream[group.requests[i].stream]);
  }
  for (const auto& [stream, outcome] : by_stream) on_progress_(stream, outcome);
}

void QueuedIngest::ForgetDiskFullWhenThereIsRoom() {
  if (store_->Health().free_bytes < kDiskHasRoomBytes) return;
  const std::lock_guard lock(mutex_);
  if (!disk_full_) return;
  spdlog::info("ingest: the disk has room again");
  disk_full_ = false;
  stats_.problem.clear();
}

}  // namespace rigcal::server
