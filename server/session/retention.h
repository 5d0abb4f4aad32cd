// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

// Which observations are kept; without limits: all.
struct RetentionOptions {
  std::chrono::hours max_age{0};  // since the session finished; 0: no limit
  uint64_t max_bytes = 0;         // of the database; 0: no limit
  bool delete_calibrated = false;
  std::chrono::milliseconds interval = std::chrono::minutes(10);
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock

  bool enabled() const { return max_age.count() > 0 || max_bytes > 0; }
};

// Since the server started.
struct RetentionStats {
  int64_t last_run_utc_ns = 0;  // 0: not yet
  uint64_t session_count = 0;   // whose observations were deleted
  std::string last_session_id;
  uint64_t kept_session_count = 0;  // are due, and a calibration was made from them
  std::string problem;              // of the last attempt; empty: none
};

// Deletes the observations of finished sessions that are too old, or of the oldest ones while the
// database is too large; then it gives the space back to the disk. Sessions with their counts stay,
// and so do the observations that a kept calibration was made from (one that has not failed),
// unless `delete_calibrated`. Each deletion is logged. Thread-safe.
class Retention {
 public:
  // `store` and `coordinator` must outlive it.
  Retention(RetentionOptions options, Store* store, SessionCoordinator* coordinator);
  ~Retention() { Shutdown(); }

  // Looks at once and then every interval. Does nothing without limits.
  void Start();
  void Shutdown() { tasks_.Shutdown(); }
  // Looks once, in the caller's thread; for tests too.
  absl::Status Run();

  bool enabled() const { return options_.enabled(); }
  RetentionStats Stats() const;

 private:
  void RunAndPlanNext();
  absl::Status DeleteDue();
  // Why the observations of a session are due; empty: they are not.
  std::string DueText(const Session& session, int64_t now_utc_ns) const;

  const RetentionOptions options_;
  Store* const store_;
  SessionCoordinator* const coordinator_;

  mutable std::mutex mutex_;
  RetentionStats stats_;

  TaskQueue tasks_{"retention"};  // its tasks use the members above
};

}  // namespace rigcal::server
