// SPDX-License-Identifier: Apache-2.0
#include "server/ingest/queued_ingest.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/ingest/batch_validation.h"

namespace rigcal::server {
namespace {

absl::Status CheckStreams(const Delivery& delivery) {
  const ObservationBatch& batch = delivery.batch;
  const bool has_batch = batch.rows() > 0 || !batch.dropped.empty();
  const StreamKey& stream = delivery.stream;
  if (has_batch && (batch.session_id != stream.session_id || batch.camera != stream.camera ||
                    batch.stream_epoch != stream.stream_epoch)) {
    return absl::InvalidArgumentError(
        absl::StrCat("batch of another stream than ", StreamName(stream)));
  }
  if (stream.stream_epoch == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(StreamName(stream), ": stream_epoch is 0; it counts from 1"));
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

}  // namespace

std::string StreamName(const StreamKey& stream) {
  return absl::StrCat("session ", stream.session_id, ", camera ", stream.camera);
}

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
    return absl::Status(status.code(), absl::StrCat(StreamName(delivery.stream), ": ",
                                                    std::string(status.message())));
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

}  // namespace rigcal::server
