// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/calibration_record.h"
#include "server/session/calibration_solver.h"
#include "server/store/store.h"

namespace rigcal::server {

// How often the queue of a shared store is looked at. Polled, as notifications and session locks do
// not survive poolers.
inline constexpr std::chrono::milliseconds kJobPoll{250};

// This process, for claims.
JobHolder ThisHolder(std::string software_version, bool is_server);

struct JobSolverOptions {
  JobHolder holder;
  int max_attempts = 3;
  size_t max_observations = 10'000'000;  // of one calibration
  // Solves nothing, and ends what nobody is to solve: cancelled, or tried too often.
  bool only_to_end = false;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// Takes calibrations from the queue of a store and solves them, one at a time. The server is one,
// and each rigcal-worker has some. RunOne is for one thread; the rest is thread-safe.
class JobSolver {
 public:
  // Called from the thread of RunOne. May be unset.
  struct Events {
    // The id under which the log shows what was asked for; see common/log/correlation_id.h.
    std::function<std::string(const std::string& id)> correlation;
    std::function<void(const Calibration&)> begun;
    std::function<void(const std::string& id, const JobProgress&)> progress;
    // What became of it. `stored`: OK; ABORTED, another process has it; else why it could not be
    // stored.
    std::function<void(const Calibration&, const absl::Status& stored)> ended;
  };

  // `store` outlives it.
  JobSolver(JobSolverOptions options, Store* store, SolveFunction solve, Events events);

  // False: there is no job. An error: none could be claimed.
  absl::StatusOr<bool> RunOne();
  // True: it is solved here, and ends soon.
  bool Cancel(std::string_view id);
  // Gives the job back at once, and takes no more.
  void Interrupt();
  // What is solved here, with its progress.
  std::optional<JobProgress> ProgressOf(std::string_view id) const;

 private:
  void Run(ClaimedJob job);
  void Solve(const JobClaim& claim, Calibration* calibration);
  // The outcome of the solve into the calibration; true: it is to be tried again.
  bool TakeOutcome(CalibrationOutcome outcome, Calibration* calibration) const;
  absl::Status Finish(const JobClaim& claim, const Calibration& calibration);
  void Report(const std::string& id, const std::function<void(JobProgress*)>& change);

  const JobSolverOptions options_;
  Store* const store_;
  const SolveFunction solve_;
  const Events events_;

  std::mutex claim_mutex_;  // held while a job is claimed; taken before mutex_
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::string running_id_;  // empty: none
  JobProgress progress_;
  bool cancel_asked_ = false;
  bool stopping_ = false;
  absl::Status lost_;                // not OK: another process has the job
  std::atomic<bool> interrupted_{};  // for any of these reasons
};

}  // namespace rigcal::server
