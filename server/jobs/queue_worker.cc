// SPDX-License-Identifier: Apache-2.0
#include "server/jobs/queue_worker.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

namespace rigcal::server {
namespace {

void TellBegin(const Calibration& calibration) {
  spdlog::info("calibration {}: begun, attempt {}", calibration.id, calibration.attempt_count);
}

void TellEnd(const Calibration& calibration, const absl::Status& stored) {
  if (absl::IsAborted(stored)) return;  // said by the solver
  if (!stored.ok()) {
    spdlog::error("calibration {}: its end cannot be stored, it is begun again: {}", calibration.id,
                  std::string(stored.message()));
  } else if (calibration.state == CalibrationState::kSucceeded) {
    spdlog::info("calibration {}: succeeded in {:.1f} s", calibration.id, calibration.duration_s);
  } else if (calibration.state == CalibrationState::kCancelled) {
    spdlog::info("calibration {}: cancelled", calibration.id);
  } else if (calibration.state == CalibrationState::kFailed) {
    spdlog::warn("calibration {}: failed: {}", calibration.id, calibration.error);
  } else {
    spdlog::info("calibration {}: given back", calibration.id);
  }
}

}  // namespace

QueueWorker::QueueWorker(QueueWorkerOptions options, Store* store, SolveFunction solve)
    : options_(std::move(options)), store_(store) {
  for (int i = 0; i < options_.jobs; ++i) {
    solvers_.push_back(std::make_unique<JobSolver>(
        options_.solver, store, solve,
        JobSolver::Events{
            .correlation = {}, .begun = TellBegin, .progress = {}, .ended = TellEnd}));
  }
}

QueueWorker::~QueueWorker() { Shutdown(); }

void QueueWorker::Start() {
  threads_.emplace_back([this] { SayItLives(); });
  for (const auto& solver : solvers_) {
    threads_.emplace_back([this, taker = solver.get()] { TakeJobs(taker); });
  }
}

void QueueWorker::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (const auto& solver : solvers_) solver->Interrupt();
  for (std::thread& thread : threads_) thread.join();
  if (!threads_.empty()) store_->ForgetWorker(options_.solver.holder).IgnoreError();
  threads_.clear();
}

bool QueueWorker::Pause(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  return !wake_.wait_for(lock, time, [this] { return stopping_; });
}

void QueueWorker::TakeJobs(JobSolver* solver) {
  bool is_away = false;
  while (true) {
    const absl::StatusOr<bool> had_one = solver->RunOne();
    if (!had_one.ok() && !is_away) {
      spdlog::warn("no calibrations are taken: {}", std::string(had_one.status().message()));
    } else if (had_one.ok() && is_away) {
      spdlog::info("calibrations are taken again");
    }
    is_away = !had_one.ok();
    if (!Pause(had_one.ok() && *had_one ? std::chrono::milliseconds(0) : kJobPoll)) return;
  }
}

void QueueWorker::SayItLives() {
  do {
    // What fails here fails where jobs are taken, and is said there.
    store_->NoteWorker(options_.solver.holder).IgnoreError();
  } while (Pause(kJobLease / 3));
}

}  // namespace rigcal::server
