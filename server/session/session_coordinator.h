// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/session/session.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_link.h"
#include "server/session/capture_orders.h"
#include "server/session/capture_sender.h"
#include "server/session/change_notifier.h"
#include "server/session/stream_context_cache.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct SessionCoordinatorOptions {
  // Sessions kept at a time, finished ones included.
  size_t max_sessions = 10000;
  size_t max_cameras_per_session = 256;
  // Clients that watch sessions at a time.
  size_t max_watches = 64;
  // Rows an agent may have unacknowledged per stream; the same as ingest's.
  uint32_t send_window = 32768;
  // After the store refused to finish a session (disk full): how long until the next attempt.
  std::chrono::milliseconds store_retry_interval{1000};
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// The ids of sessions that cannot be deleted while it lives. Must not outlive the coordinator.
using SessionHold = std::shared_ptr<const std::vector<std::string>>;

// Takes sessions from created over capturing and draining to finished. Sends commands to agents
// through their links, watches acknowledgements for the end of every camera, and keeps drain
// deadlines.
// Thread-safe. Calls that change a session are made one after the other and return when the change
// is durable; links are called on the coordinator's own thread with no lock held, in the order of
// the changes.
//
// Sessions that were capturing or draining when the server ended continue: their agents get the
// commands again when they connect.
class SessionCoordinator {
 public:
  // Reads the sessions from `store`, with its errors. `store` and `directory` must outlive the
  // coordinator.
  static absl::StatusOr<std::unique_ptr<SessionCoordinator>> Create(
      SessionCoordinatorOptions options, Store* store, AgentDirectory* directory);
  ~SessionCoordinator() { Shutdown(); }

  // Starts the thread that sends commands and finishes sessions.
  void Start() { tasks_.Start(); }
  // Ends the thread. Sessions stay as they are.
  void Shutdown() { tasks_.Shutdown(); }
  // Returns when all commands have been sent and all finished sessions are stored (deadlines not
  // awaited). Only between Start and Shutdown.
  void WaitIdle() { tasks_.WaitIdle(); }

  // --- Sessions; errors as in rigcal/v1/session.proto ---
  absl::StatusOr<Session> CreateSession(Session session);
  absl::StatusOr<Session> StartSession(std::string_view id);
  // `drain_timeout_s` 0: 10 s. `reason`: why, where no person stops it; see Session::stop_reason.
  absl::StatusOr<Session> StopSession(std::string_view id, double drain_timeout_s,
                                      std::string_view reason = {});
  absl::Status DeleteSession(std::string_view id);
  // Marks it as thrown away, or takes that back; nothing is deleted. FAILED_PRECONDITION: it is
  // capturing or draining.
  absl::StatusOr<Session> DiscardSession(std::string_view id, bool undo);
  // The observations of a finished session; its counts stay. FAILED_PRECONDITION: it has not
  // finished, or somebody reads it.
  absl::Status DeleteObservations(std::string_view id);
  // As ChangeNotifier::Add, also for a session that does not exist.
  absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>> WatchSession(std::string_view id,
                                                                      std::function<void()> wake) {
    return changes_.Add(id, std::move(wake));
  }
  // NOT_FOUND names the first session that does not exist.
  absl::StatusOr<SessionHold> HoldSessions(const std::vector<std::string>& ids);
  size_t SessionCount() const { return contexts_.size(); }
  size_t CapturingCount() const;
  // Those that capture or drain, by id.
  std::vector<Session> ActiveSessions() const;
  // Grows whenever a session is created, changes its state or is deleted; not with its counts.
  uint64_t ChangeCount() const { return change_count_.load(); }

  // --- Agents ---
  struct AgentConnection {
    AgentDirectory::Registration registration = 0;
    std::vector<StreamPosition> positions;  // one for each of `pending`, in its order
  };
  // Registers the agent, and sends it the commands of the sessions that run with its cameras. Reads
  // the store: not for a thread that must not block. Errors as AgentDirectory::Register, and the
  // store's.
  absl::StatusOr<AgentConnection> ConnectAgent(AgentRecord agent,
                                               absl::Span<const StreamKey> pending,
                                               std::shared_ptr<AgentLink> link);
  // What the agent says about its spool. Never blocks on the disk.
  void RecordSpool(AgentDirectory::Registration registration, SpoolStatus status) {
    directory_->SetSpool(registration, std::move(status));
  }
  // What it says about one stream. Never blocks on the disk.
  void RecordStreamReport(const StreamKey& stream, SpoolReport report) {
    directory_->SetStreamReport(stream, std::move(report));
  }
  // Never blocks on the disk.
  void DisconnectAgent(AgentDirectory::Registration registration);

  // --- Ingest ---
  // What deliveries are checked against. Never blocks on the disk.
  const StreamContextCache& contexts() const { return contexts_; }
  // Notes what a commit has added to a stream. Never blocks on the disk.
  void RecordProgress(const StreamKey& stream, const AppendOutcome& outcome);

 private:
  SessionCoordinator(SessionCoordinatorOptions options, Store* store, AgentDirectory* directory);
  absl::Status Load();
  void Activate(const Session& session);
  // Looks after `delay` whether every camera has ended; nothing happens where that is planned.
  void PostFinishCheck(const std::string& id, std::chrono::milliseconds delay = {});
  // Finishes the session after `delay`, whatever is missing then.
  void PostDeadline(const std::string& id, std::chrono::nanoseconds delay);
  void FinishIfEnded(const std::string& id, bool overdue);

  const SessionCoordinatorOptions options_;
  std::atomic<uint64_t> change_count_ = 0;
  Store* const store_;
  AgentDirectory* const directory_;
  const CaptureOrders orders_;
  StreamContextCache contexts_;
  CaptureSender sender_;
  ChangeNotifier changes_;

  // Held over a whole change, the store's part included. Taken before mutex_.
  mutable std::mutex change_mutex_;
  // Held briefly only.
  mutable std::mutex mutex_;
  std::map<std::string, Session, std::less<>> active_;  // capturing or draining
  std::set<std::string> finish_checks_;                 // posted, not begun

  TaskQueue tasks_{"sessions"};  // its tasks use the members above
};

}  // namespace rigcal::server
