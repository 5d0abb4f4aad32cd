// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/queued_ingest.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <limits>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/ingest/batch_validation.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::seconds kDiskFullCheckInterval{1};
// Less than this on the disk counts as full.
constexpr uint64_t kDiskHasRoomBytes = 16u << 20;

std::string Name(const StreamKey& stream) {
  return absl::StrCat("session ", stream.session_id, ", camera ", stream.camera);
}

absl::Status CheckStreams(const Delivery& delivery) {
  const ObservationBatch& batch = delivery.batch;
  const bool has_batch = batch.rows() > 0 || !batch.dropped.empty();
  const StreamKey& stream = delivery.stream;
  if (has_batch && (batch.session_id != stream.session_id || batch.camera != stream.camera ||
                    batch.stream_epoch != stream.stream_epoch)) {
    return absl::InvalidArgumentError(absl::StrCat("batch of another stream than ", Name(stream)));
  }
  if (stream.stream_epoch == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(Name(stream), ": stream_epoch is 0; it counts from 1"));
  }
  return absl::OkStatus();
}

AppendRequest MakeRequest(Delivery delivery, std::vector<RefusedRow> refused_rows) {
  AppendRequest request;
  request.stream = std::move(delivery.stream);
  request.batch = std::move(delivery.batch);
  request.refused_rows = std::move(refused_rows);
  request.report = std::move(delivery.report);
  if (delivery.end) {
    request.last_seq = delivery.end->last_seq;
    request.report = std::move(delivery.end->report);
  }
  return request;
}

void AddUp(const AppendOutcome& outcome, AppendOutcome* total) {
  AppendOutcome sum = outcome;
  sum.stored_rows += total->stored_rows;
  sum.duplicate_rows += total->duplicate_rows;
  sum.refused_rows += total->refused_rows;
  *total = sum;
}

}  // namespace

absl::StatusOr<std::unique_ptr<QueuedIngest>> QueuedIngest::Create(
    const IngestOptions& options, Store* store, const StreamContextSource* contexts,
    ProgressHook on_progress) {
  RIGCAL_RETURN_IF_ERROR(options.Validate());
  return std::unique_ptr<QueuedIngest>(
      new QueuedIngest(options, store, contexts, std::move(on_progress)));
}

QueuedIngest::QueuedIngest(const IngestOptions& options, Store* store,
                           const StreamContextSource* contexts, ProgressHook on_progress)
    : options_(options), store_(store), contexts_(contexts), on_progress_(std::move(on_progress)) {}

QueuedIngest::~QueuedIngest() { Shutdown(); }

void QueuedIngest::Start() {
  writer_ = std::thread([this] { RunWriter(); });
}

void QueuedIngest::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  work_.notify_all();
  if (writer_.joinable()) {
    writer_.join();
  } else {
    AnswerUnwritten();
  }
}

// What was submitted to a writer that never ran.
void QueuedIngest::AnswerUnwritten() {
  std::deque<Entry> queue;
  std::vector<std::function<void()>> space_waiters;
  {
    const std::lock_guard lock(mutex_);
    queue.swap(queue_);
    space_waiters.swap(space_waiters_);
    held_bytes_ = 0;
  }
  for (const Entry& entry : queue) {
    entry.done(absl::UnavailableError("the server shuts down; try again later"));
  }
  for (const auto& on_space : space_waiters) on_space();
}

void QueuedIngest::WaitIdle() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return queue_.empty() && validating_ == 0 && !writing_; });
}

absl::Status QueuedIngest::Submit(Delivery& delivery, IngestCallback done,
                                  std::function<void()> on_space) {
  RIGCAL_RETURN_IF_ERROR(CheckStreams(delivery));
  RIGCAL_ASSIGN_OR_RETURN(const StreamContext context,
                          contexts_->GetStreamContext(delivery.stream));
  const size_t bytes = delivery.Bytes();
  RIGCAL_RETURN_IF_ERROR(Reserve(bytes, on_space));

  BatchFaults faults;
  if (absl::Status status = ValidateBatch(context, delivery.batch, &faults); !status.ok()) {
    ReleaseReservation(bytes);
    return absl::Status(status.code(),
                        absl::StrCat(Name(delivery.stream), ": ", std::string(status.message())));
  }
  Entry entry;
  entry.fault_count = static_cast<uint32_t>(faults.rows.size());
  entry.faults = std::move(faults.listed);
  // What validation has added was not known when room was reserved.
  entry.bytes = bytes + faults.rows.capacity() * sizeof(RefusedRow);
  entry.request = MakeRequest(std::move(delivery), std::move(faults.rows));
  entry.done = std::move(done);
  {
    const std::lock_guard lock(mutex_);
    held_bytes_ += entry.bytes - bytes;
    --validating_;
    queue_.push_back(std::move(entry));
  }
  work_.notify_one();
  return absl::OkStatus();
}

absl::Status QueuedIngest::Reserve(size_t bytes, std::function<void()>& on_space) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return absl::UnavailableError("the server is shutting down; try again later");
  if (!failed_.ok()) return failed_;
  if (held_bytes_ >= options_.queue_limit_bytes) {
    if (on_space) space_waiters_.push_back(std::move(on_space));
    return absl::ResourceExhaustedError(
        absl::StrCat("the server's queue is full (", held_bytes_, " bytes); try again later"));
  }
  held_bytes_ += bytes;
  ++validating_;
  return absl::OkStatus();
}

void QueuedIngest::ReleaseReservation(size_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    held_bytes_ -= bytes;
    --validating_;
  }
  idle_.notify_all();
  work_.notify_one();  // somebody may wait for this room, or for the last validation
}

IngestStats QueuedIngest::Stats() const {
  const std::lock_guard lock(mutex_);
  IngestStats stats = stats_;
  stats.queue_bytes = held_bytes_;
  return stats;
}

void QueuedIngest::RunWriter() {
  std::unique_lock lock(mutex_);
  while (HasWork() || !stopping_ || validating_ > 0) {
    WaitForWork(lock);
    const std::vector<std::function<void()>> space_waiters = TakeSpaceWaiters();
    Group group = TakeGroup();
    const size_t group_bytes = group.bytes;
    writing_ = true;
    lock.unlock();

    for (const auto& on_space : space_waiters) on_space();
    Write(std::move(group));

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

void QueuedIngest::Write(Group group) {
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
      entry.done(absl::NotFoundError(absl::StrCat(Name(stream), ": there is none (any more)")));
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
