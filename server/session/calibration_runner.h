// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_options.h"
#include "common/calibration/calibration_record.h"
#include "server/session/calibration_solver.h"
#include "server/session/change_notifier.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"
#include "server/store/store.h"

namespace rigcal::server {

struct CalibrationRunnerOptions {
  size_t max_queued = 32;
  // Of one calibration.
  size_t max_observations = 10'000'000;
  // Clients that watch calibrations at a time.
  size_t max_watches = 64;
  // How often a calibration is started again that ended with the server (kill -9, out of memory).
  int max_attempts = 3;
  std::string software_version;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// What is kept with a calibration besides its options.
struct CalibrationNote {
  std::string operator_name;  // empty: the server's own PC
  std::string reason, notes;
};

// Runs calibrations one after the other on a thread of its own. A calibration that was queued or
// running when the server ended is queued again. Progress is kept in memory only. Thread-safe.
class CalibrationRunner {
 public:
  // `store` and `coordinator` must outlive the runner. Errors: the store's.
  static absl::StatusOr<std::unique_ptr<CalibrationRunner>> Create(CalibrationRunnerOptions options,
                                                                   Store* store,
                                                                   SessionCoordinator* coordinator,
                                                                   SolveFunction solve);
  ~CalibrationRunner();

  void Start() { tasks_.Start(); }
  // Stops the running calibration, which is queued again at the next start.
  void Shutdown();
  // Returns when nothing is queued or running. Only between Start and Shutdown.
  void WaitIdle() { tasks_.WaitIdle(); }

  // Errors of these as in rigcal/v1/calibration.proto.
  absl::StatusOr<Calibration> CreateCalibration(std::vector<std::string> session_ids,
                                                CalibrationOptions options,
                                                CalibrationNote note = {});
  absl::StatusOr<Calibration> GetCalibration(std::string_view id) const;
  absl::StatusOr<std::vector<Listed<Calibration>>> ListCalibrations(const CalibrationFilter& filter,
                                                                    const ListPage& page) const;
  absl::StatusOr<Calibration> CancelCalibration(std::string_view id);
  absl::Status DeleteCalibration(std::string_view id);
  // As ChangeNotifier::Add, also for a calibration that does not exist.
  absl::StatusOr<std::unique_ptr<ChangeNotifier::Watch>> WatchCalibration(
      std::string_view id, std::function<void()> wake) {
    return changes_.Add(id, std::move(wake));
  }
  size_t QueuedCount() const;

 private:
  struct Job {
    std::string id;
    SessionHold hold;
    std::string correlation;  // of the request; see common/log/correlation_id.h
  };

  CalibrationRunner(CalibrationRunnerOptions options, Store* store, SessionCoordinator* coordinator,
                    SolveFunction solve);
  absl::Status QueueUnfinished();
  // The first job of the queue; none: it was cancelled.
  void RunNext();
  void RunJob(const Job& job);
  absl::Status Begin(Calibration* calibration);
  void Solve(Calibration* calibration);
  void End(Calibration calibration);
  void ReportProgress(CalibrationStage stage, double fraction);
  void ReportSilence(bool not_responding);
  Calibration WithMemory(Calibration calibration) const;

  const CalibrationRunnerOptions options_;
  Store* const store_;
  SessionCoordinator* const coordinator_;
  const SolveFunction solve_;
  ChangeNotifier changes_;

  std::mutex create_mutex_;  // held over a whole CreateCalibration; taken before mutex_
  mutable std::mutex mutex_;
  std::deque<Job> queue_;
  std::string running_id_;  // empty: none
  CalibrationStage stage_ = CalibrationStage::kUnspecified;
  double fraction_ = 0;
  bool not_responding_ = false;
  std::chrono::steady_clock::time_point last_notification_;
  // Ended, but the store refused to take it: shown as failed until the next start tries again.
  std::map<std::string, Calibration, std::less<>> unsaved_;
  bool stopping_ = false;
  bool cancel_asked_ = false;        // by a client
  std::atomic<bool> interrupted_{};  // by a client or by Shutdown
  TaskQueue tasks_{"calibrations"};  // one RunNext for each job; uses the members above
};

}  // namespace rigcal::server
