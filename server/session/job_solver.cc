// SPDX-License-Identifier: Apache-2.0
#include "server/session/job_solver.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <exception>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/log/correlation_id.h"
#include "common/log/log_fields.h"
#include "common/status/status_macros.h"
#include "server/identity/server_identity.h"
#include "server/session/calibration_request.h"
#include "server/session/job_heartbeat.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

void SetFailed(std::string error, Calibration* calibration) {
  calibration->state = CalibrationState::kFailed;
  calibration->error = std::move(error);
  calibration->result.reset();
}

// To be begun again, by whoever takes it.
void GiveBack(bool counts, Calibration* calibration) {
  calibration->state = CalibrationState::kQueued;
  calibration->error.clear();
  calibration->refused.clear();
  calibration->start_utc_ns = 0;
  if (!counts && calibration->attempt_count > 0) --calibration->attempt_count;
}

}  // namespace

JobHolder ThisHolder(std::string software_version, bool is_server) {
  return {.host = OwnHostName(),
          .pid = getpid(),
          .software_version = std::move(software_version),
          .is_server = is_server};
}

JobSolver::JobSolver(JobSolverOptions options, Store* store, SolveFunction solve, Events events)
    : options_(std::move(options)),
      store_(store),
      solve_(std::move(solve)),
      events_(std::move(events)) {}

absl::StatusOr<bool> JobSolver::RunOne() {
  std::optional<ClaimedJob> job;
  {
    const std::lock_guard claiming(claim_mutex_);
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) return false;
    }
    RIGCAL_ASSIGN_OR_RETURN(
        job, store_->ClaimJob(options_.holder, {.max_attempts = options_.max_attempts,
                                                .only_to_end = options_.only_to_end,
                                                .utc_now_ns = UtcNowNs(options_.utc_now_ns)}));
    if (!job) return false;
    const std::lock_guard lock(mutex_);
    running_id_ = job->claim.calibration_id;
    progress_ = {.stage = CalibrationStage::kReading};
    cancel_asked_ = job->cancel;
    lost_ = absl::OkStatus();
    interrupted_ = stopping_;
  }
  Run(*std::move(job));
  const std::lock_guard lock(mutex_);
  running_id_.clear();
  return true;
}

void JobSolver::Run(ClaimedJob job) {
  const std::string& id = job.claim.calibration_id;
  std::string correlation = events_.correlation ? events_.correlation(id) : std::string();
  if (correlation.empty()) correlation = NewCorrelationId();
  const LogScope scope({.calibration = id, .correlation = correlation});
  if (!job.damage.ok()) {
    spdlog::error("calibration {}: cannot be read, tried again at the next start: {}", id,
                  std::string(job.damage.message()));
    return;
  }
  if (events_.begun) events_.begun(job.calibration);
  if (!job.give_up.empty()) {
    SetFailed(job.give_up, &job.calibration);
  } else if (!job.cancel) {
    Solve(job.claim, &job.calibration);
  }
  absl::Status lost;
  {
    const std::lock_guard lock(mutex_);
    lost = lost_;
    if (cancel_asked_) {
      SetFailed("cancelled", &job.calibration);
      job.calibration.state = CalibrationState::kCancelled;
    } else if (stopping_ && job.calibration.state != CalibrationState::kSucceeded) {
      // A clean stop is no failed attempt.
      GiveBack(false, &job.calibration);
    }
  }
  job.calibration.progress_stage = CalibrationStage::kUnspecified;
  if (job.calibration.state != CalibrationState::kQueued) {
    job.calibration.end_utc_ns = UtcNowNs(options_.utc_now_ns);
  }
  const absl::Status stored = lost.ok() ? Finish(job.claim, job.calibration) : lost;
  if (absl::IsAborted(stored)) {
    spdlog::error("calibration {}: refused: {}", id, std::string(stored.message()));
  }
  if (events_.ended) events_.ended(job.calibration, stored);
}

void JobSolver::Solve(const JobClaim& claim, Calibration* calibration) {
  std::unique_ptr<JobHeartbeat> heartbeat;
  if (store_->jobs_are_shared()) {
    const auto cancel = [this] {
      const std::lock_guard lock(mutex_);
      cancel_asked_ = true;
      interrupted_ = true;
    };
    const auto lose = [this](const absl::Status& why) {
      const std::lock_guard lock(mutex_);
      lost_ = why;
      interrupted_ = true;
    };
    heartbeat = std::make_unique<JobHeartbeat>(
        store_, claim, JobHeartbeat::Events{.cancel = cancel, .lost = lose});
  }
  const std::string& id = claim.calibration_id;
  const auto report = [&](const std::function<void(JobProgress*)>& change) {
    Report(id, change);
    if (heartbeat == nullptr) return;
    const std::lock_guard lock(mutex_);
    heartbeat->Report(progress_);
  };
  CalibrationHooks hooks;
  hooks.progress = [&](CalibrationStage stage, double fraction) {
    report([&](JobProgress* progress) {
      progress->stage = stage;
      progress->fraction = fraction;
    });
  };
  hooks.silence = [&](bool not_responding) {
    report([&](JobProgress* progress) { progress->not_responding = not_responding; });
  };
  hooks.cancelled = &interrupted_;
  try {
    // It may have been asked for in an earlier version.
    if (const absl::Status valid = calibration->options.Validate(); !valid.ok()) {
      return SetFailed(std::string(valid.message()), calibration);
    }
    const auto start = std::chrono::steady_clock::now();
    const auto parent = ParentOf(*store_, calibration->options);
    CalibrationOutcome outcome =
        parent.ok() ? solve_({.store = *store_,
                              .session_ids = calibration->session_ids,
                              .max_observations = options_.max_observations,
                              .options = calibration->options,
                              .parent = *parent ? &**parent : nullptr},
                             hooks)
                    : CalibrationOutcome{parent.status(), {}, absl::IsUnavailable(parent.status())};
    calibration->duration_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (TakeOutcome(std::move(outcome), calibration)) {
      spdlog::warn("calibration {}: begun again, the store was gone: {}", id, calibration->error);
      GiveBack(true, calibration);
    }
  } catch (const std::exception& error) {
    SetFailed(absl::StrCat("an unexpected fault while solving: ", error.what()), calibration);
  }
}

bool JobSolver::TakeOutcome(CalibrationOutcome outcome, Calibration* calibration) const {
  if (!outcome.result.ok()) {
    calibration->refused = std::move(outcome.refused);
    SetFailed(std::string(outcome.result.status().message()), calibration);
    return outcome.store_was_gone && store_->jobs_are_shared() &&
           calibration->attempt_count < static_cast<uint32_t>(options_.max_attempts);
  }
  calibration->state = CalibrationState::kSucceeded;
  calibration->progress_fraction = 1;
  calibration->result = *std::move(outcome.result);
  return false;
}

absl::Status JobSolver::Finish(const JobClaim& claim, const Calibration& calibration) {
  for (bool is_told = false;; is_told = true) {
    const absl::Status status = store_->FinishJob(claim, calibration);
    if (!absl::IsUnavailable(status) || !store_->jobs_are_shared()) return status;
    if (!is_told) {
      spdlog::warn("calibration {}: its end waits for the store: {}", claim.calibration_id,
                   std::string(status.message()));
    }
    std::unique_lock lock(mutex_);
    if (wake_.wait_for(lock, kJobPoll, [this] { return stopping_; })) return status;
  }
}

void JobSolver::Report(const std::string& id, const std::function<void(JobProgress*)>& change) {
  JobProgress progress;
  {
    const std::lock_guard lock(mutex_);
    change(&progress_);
    progress = progress_;
  }
  if (events_.progress) events_.progress(id, progress);
}

bool JobSolver::Cancel(std::string_view id) {
  const std::lock_guard claiming(claim_mutex_);
  const std::lock_guard lock(mutex_);
  if (running_id_.empty() || id != running_id_) return false;
  cancel_asked_ = true;
  interrupted_ = true;
  return true;
}

void JobSolver::Interrupt() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    interrupted_ = true;
  }
  wake_.notify_all();
}

std::optional<JobProgress> JobSolver::ProgressOf(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  if (running_id_.empty() || id != running_id_) return std::nullopt;
  return progress_;
}

}  // namespace rigcal::server
