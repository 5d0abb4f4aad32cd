// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/ingest/ingest.h"
#include "server/store/store.h"

namespace rigcal::server {

// "session s-000001, camera left", for messages.
std::string StreamName(const StreamKey& stream);

// Called on the writer's thread after a commit, once for each stream in it: the counts of its
// deliveries added up, the rest as after the last one. Must not block for long: no other commit
// begins meanwhile.
using ProgressHook = std::function<void(const StreamKey&, const AppendOutcome&)>;

// Ingest with one writer thread. Whatever has queued up during a commit goes into the next one (up
// to group_limit_bytes); nothing waits for more to come.
//
// When the disk is full the deliveries of that commit are given back with RESOURCE_EXHAUSTED, and
// the next ones are tried as they come. After any other error of the store nothing is taken any
// more. IngestStats::problem tells of both.
class QueuedIngest : public Ingest {
 public:
  // `store` and `contexts` must outlive the ingest; `on_progress` may be empty. INVALID_ARGUMENT:
  // the options.
  static absl::StatusOr<std::unique_ptr<QueuedIngest>> Create(const IngestOptions& options,
                                                              Store* store,
                                                              const StreamContextSource* contexts,
                                                              ProgressHook on_progress);
  ~QueuedIngest() override;  // shuts down

  // Starts the writer; deliveries may be submitted before, and wait. Once only.
  void Start();
  // Takes no more, writes what was taken, calls every callback, ends the writer. Not from two
  // threads at once.
  void Shutdown();
  // Returns when everything taken so far is written and its callbacks have returned. The writer
  // must run.
  void WaitIdle();

  absl::Status Submit(Delivery& delivery, IngestCallback done,
                      std::function<void()> on_space) override;
  IngestStats Stats() const override;

 private:
  struct Entry {
    AppendRequest request;
    IngestCallback done;
    std::vector<ObservationFault> faults;
    uint32_t fault_count = 0;
    size_t bytes = 0;
  };
  // Deliveries of one commit; requests[i] belongs to entries[i].
  struct Group {
    std::vector<AppendRequest> requests;
    std::vector<Entry> entries;  // their requests moved out
    size_t bytes = 0;
  };

  QueuedIngest(const IngestOptions& options, Store* store, const StreamContextSource* contexts,
               ProgressHook on_progress);

  absl::Status Reserve(size_t bytes, std::function<void()>& on_space);
  void ReleaseReservation(size_t bytes);

  void AnswerUnwritten();
  void RunWriter();
  void WaitForWork(std::unique_lock<std::mutex>& lock);
  bool HasWork() const;
  std::vector<std::function<void()>> TakeSpaceWaiters();
  Group TakeGroup();
  void Write(const Group& group);
  absl::StatusOr<std::vector<AppendOutcome>> Append(const Group& group);
  void NoteResult(const absl::StatusOr<std::vector<AppendOutcome>>& outcomes);
  void Answer(const Group& group, const std::vector<AppendOutcome>& outcomes) const;
  void ReportProgress(const Group& group, const std::vector<AppendOutcome>& outcomes) const;
  void ForgetDiskFullWhenThereIsRoom();

  const IngestOptions options_;
  Store* const store_;
  const StreamContextSource* const contexts_;
  const ProgressHook on_progress_;

  mutable std::mutex mutex_;
  std::condition_variable work_;
  std::condition_variable idle_;
  std::deque<Entry> queue_;
  std::vector<std::function<void()>> space_waiters_;
  size_t held_bytes_ = 0;  // queued, in the commit under way, and being validated
  int validating_ = 0;     // calls of Submit that have reserved and not queued yet
  bool writing_ = false;   // a group has been taken and not been answered
  bool stopping_ = false;
  bool disk_full_ = false;
  absl::Status failed_;  // not OK: nothing is taken any more
  IngestStats stats_;

  std::thread writer_;
};

}  // namespace rigcal::server
