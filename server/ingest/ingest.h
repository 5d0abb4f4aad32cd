// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/session/stream_key.h"
#include "server/ingest/batch_validation.h"
#include "server/ingest/ingest_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct IngestOptions {
  // Bytes of waiting deliveries at which Submit reports that the queue is full.
  size_t queue_limit_bytes = 64u << 20;
  // One transaction takes at most this many bytes of deliveries.
  size_t group_limit_bytes = 1u << 20;
  // Rows an agent may have unacknowledged per stream.
  uint32_t send_window = 32768;
};

struct IngestStats {
  uint64_t stored_observation_count = 0;
  uint64_t duplicate_observation_count = 0;
  uint64_t refused_observation_count = 0;
  uint64_t conflict_observation_count = 0;  // delivered again with other values
  uint64_t commit_count = 0;
  size_t queue_bytes = 0;
  std::string problem;  // empty: healthy
};

// The camera and target of a stream. NOT_FOUND: no such session, or no such camera in it.
// FAILED_PRECONDITION: not started. Thread-safe, never blocks on the disk.
using FindStreamContext = std::function<absl::StatusOr<StreamContext>(const StreamKey&)>;

// Called on the writer's thread after a commit, once for each stream in it: the counts of its
// deliveries added up, the rest as after the last one. Must not block for long: no other commit
// begins meanwhile.
using ProgressHook = std::function<void(const StreamKey&, const AppendOutcome&)>;

// Called on the writer's thread after a commit and its acknowledgements, once for each delivery in
// it whose session exists. Every microsecond in it delays the next commit.
using DeliveryHook = std::function<void(const Delivery&, const AppendOutcome&)>;

// Checks deliveries and writes them with one thread: an acknowledgement means that the rows are on
// disk. Everything queued during a commit goes into the next one (up to group_limit_bytes); nothing
// waits for more to arrive. What a callback or hook throws is logged and ends there: the rows are
// durable, and the others are called.
//
// When the disk is full, the deliveries of that commit are given back with RESOURCE_EXHAUSTED, and
// the next ones are tried as they arrive. After any other error of the store nothing is accepted
// any more. IngestStats::problem reports both.
class Ingest {
 public:
  // `store` must outlive the ingest; `on_progress` and `on_delivery` may be empty.
  Ingest(const IngestOptions& options, Store* store, FindStreamContext find_context,
         ProgressHook on_progress, DeliveryHook on_delivery = {});
  ~Ingest();  // shuts down

  // Starts the writer; deliveries may be submitted before, and wait. Once only.
  void Start();
  // Accepts no more, writes what was accepted, calls every callback, ends the writer. Not from two
  // threads at once.
  void Shutdown();
  // Returns when everything accepted so far is written and its callbacks have returned. The writer
  // must run.
  void WaitIdle() { queue_.WaitIdle(); }

  // Checks the values of `delivery` and queues it. Thread-safe; never blocks.
  //   OK                  accepted; `done` is called exactly once, later, on the writer's thread,
  //                       and must not block
  //   INVALID_ARGUMENT    fault in protocol (marker count); the message names the field
  //   NOT_FOUND, FAILED_PRECONDITION   from the FindStreamContext
  //   RESOURCE_EXHAUSTED  the queue is full; `delivery` is untouched, and `on_space` is called once
  //                       when there is room again, or at shutdown (on the writer's thread)
  //   UNAVAILABLE         shutting down
  //   INTERNAL            the store has failed, see IngestStats::problem; a restart is needed
  // `done` gets NOT_FOUND when the session was deleted meanwhile, RESOURCE_EXHAUSTED when the disk
  // is full (nothing of the delivery is stored; send it again later), else the store's error.
  // `delivery` is moved from only when OK.
  absl::Status Submit(Delivery& delivery, IngestCallback done, std::function<void()> on_space);
  IngestStats Stats() const;

 private:
  absl::Status failed() const;
  bool disk_full() const;
  void RunWriter();
  void Write(const IngestQueue::Group& group);
  absl::StatusOr<std::vector<AppendOutcome>> Append(const IngestQueue::Group& group);
  void NoteResult(const absl::StatusOr<std::vector<AppendOutcome>>& outcomes);
  void Answer(const IngestQueue::Group& group, const std::vector<AppendOutcome>& outcomes) const;
  void ReportProgress(const IngestQueue::Group& group,
                      const std::vector<AppendOutcome>& outcomes) const;
  void ReportDeliveries(const IngestQueue::Group& group,
                        const std::vector<AppendOutcome>& outcomes) const;
  void ForgetDiskFullWhenThereIsRoom();

  const IngestOptions options_;
  Store* const store_;
  const FindStreamContext find_context_;
  const ProgressHook on_progress_;
  const DeliveryHook on_delivery_;
  IngestQueue queue_;

  mutable std::mutex mutex_;
  bool disk_full_ = false;
  absl::Status failed_;  // not OK: nothing is accepted any more
  IngestStats stats_;

  std::thread writer_;
};

}  // namespace rigcal::server
