// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_options.h"
#include "common/calibration/calibration_record.h"
#include "server/session/calibration_solver.h"
#include "server/session/change_notifier.h"
#include "server/session/job_solver.h"
#include "server/session/session_coordinator.h"
#include "server/session/task_queue.h"
#include "server/session/utc_clock.h"
#include "server/store/store.h"

namespace rigcal::server {

struct CalibrationRunnerOptions {
  size_t max_queued = 32;
  // Of one calibration.
  size_t max_observations = 10'000'000;
  // Clients that watch calibrations at a time.
  size_t max_watches = 64;
  // How often a calibration is begun that ended with who solved it (kill -9, out of memory).
  int max_attempts = 3;
  std::string software_version;
  // False: rigcal-workers solve, this server ends only what none of them is to solve.
  bool solve_here = true;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// What is kept with a calibration besides its options.
struct CalibrationNote {
  std::string operator_name;  // empty: the server's own PC
  std::string reason, notes;
};

// Creates calibrations, solves them one after the other on a thread of its own, and follows those
// that others solve from the same store. The queue is in the store: a calibration that was queued
// or that this server solved when it ended is queued again, and one that a rigcal-worker solves
// goes on. Sessions are held until their calibrations have ended. Thread-safe.
class CalibrationRunner {
 public:
  // `store` and `coordinator` must outlive the runner. Errors: the store's.
  static absl::StatusOr<std::unique_ptr<CalibrationRunner>> Create(CalibrationRunnerOptions options,
                                                                   Store* store,
                                                                   SessionCoordinator* coordinator,
                                                                   SolveFunction solve);
  ~CalibrationRunner();

  void Start();
  // Stops the running calibration, which is queued again.
  void Shutdown();
  // Returns when nothing is queued or running here. Only between Start and Shutdown.
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
  // Who solves, this server first where it does; others as of the last second. Never waits.
  std::vector<SolveWorker> Workers() const;

 private:
  // A calibration that has not ended.
  struct Unfinished {
    SessionHold hold;
    std::string correlation;  // of the request; see common/log/correlation_id.h
    CalibrationJob job;       // as last seen
    std::string waiting;      // why nobody solves it
  };

  CalibrationRunner(CalibrationRunnerOptions options, Store* store, SessionCoordinator* coordinator,
                    SolveFunction solve);
  JobSolver::Events SolverEvents();
  absl::Status QueueUnfinished();
  void RunNext();
  void PostRun();
  // The first one queued is shown as failed until it is begun.
  void NoteNotBegun(const absl::Status& why);
  void NoteBegun(const Calibration& calibration);
  void NoteProgress(const std::string& id, const JobProgress& progress);
  void NoteEnd(Calibration calibration, const absl::Status& stored);
  // Looks at the queue until Shutdown: of a store that others solve from.
  void Follow();
  absl::Status Look();
  void TakeJobs(const std::vector<std::string>& known, std::vector<CalibrationJob> jobs,
                const std::vector<SolveWorker>& workers);
  std::string WhyNobodySolves(const CalibrationJob& job,
                              const std::vector<SolveWorker>& workers) const;
  bool IsForThisServer(const CalibrationJob& job) const;
  Unfinished AddUnfinished(CalibrationJob job) const;
  Calibration WithMemory(Calibration calibration) const;

  const CalibrationRunnerOptions options_;
  Store* const store_;
  SessionCoordinator* const coordinator_;
  ChangeNotifier changes_;
  JobSolver solver_;

  std::mutex create_mutex_;  // held over a whole CreateCalibration; taken before mutex_
  mutable std::mutex mutex_;
  std::map<std::string, Unfinished, std::less<>> unfinished_;  // by id
  JobProgress last_progress_;
  std::chrono::steady_clock::time_point last_notification_;
  // Ended, but the store refused to take it: shown as failed until the next start tries again.
  std::map<std::string, Calibration, std::less<>> unsaved_;
  std::vector<SolveWorker> workers_;
  int look_count_ = 0;  // of the follower
  const int64_t start_utc_ns_ = UtcNowNs({});
  bool stopping_ = false;
  bool is_run_posted_ = false;  // by Follow
  std::condition_variable wake_;
  TaskQueue tasks_{"calibrations"};  // RunNext; uses the members above
  std::thread follower_;             // likewise
};

}  // namespace rigcal::server
