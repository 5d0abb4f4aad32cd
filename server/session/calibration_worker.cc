// SPDX-License-Identifier: Apache-2.0
// The part of CalibrationRunner that runs on its own thread.
#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/status/status_macros.h"
#include "server/session/calibration_input.h"
#include "server/session/calibration_runner.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr size_t kMaxUnsaved = 64;
constexpr char kAttempt[] = "attempt ";

// A running calibration carries its attempt in its stored stage, which nobody sees while it runs:
// the stage of a running one is shown from memory.
int AttemptOf(const Calibration& calibration) {
  absl::string_view stage = calibration.progress_stage;
  int attempt = 0;
  if (calibration.state == CalibrationState::kRunning && absl::ConsumePrefix(&stage, kAttempt) &&
      absl::SimpleAtoi(stage, &attempt)) {
    return attempt;
  }
  return 0;
}

void Fail(std::string error, Calibration* calibration) {
  calibration->state = CalibrationState::kFailed;
  calibration->error = std::move(error);
  calibration->result.reset();
}

}  // namespace

void CalibrationRunner::Start() {
  std::lock_guard lock(mutex_);
  if (!thread_.joinable() && !stopping_) thread_ = std::thread([this] { Run(); });
}

void CalibrationRunner::Shutdown() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    interrupted_ = true;
  }
  wake_.notify_all();
  idle_.notify_all();
  if (thread_.joinable()) thread_.join();
  changes_.Shutdown();
}

void CalibrationRunner::WaitIdle() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return stopping_ || (queue_.empty() && running_id_.empty()); });
}

void CalibrationRunner::Run() {
  while (true) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      running_id_.clear();
      if (queue_.empty()) idle_.notify_all();
      wake_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
      if (stopping_) return;
      job = std::move(queue_.front());
      queue_.pop_front();
      running_id_ = job.id;
      stage_ = "reading";
      fraction_ = 0;
      cancel_asked_ = false;
      interrupted_ = false;
    }
    RunJob(job);
  }
}

void CalibrationRunner::RunJob(const Job& job) {
  absl::StatusOr<Calibration> calibration = store_->GetCalibration(job.id);
  if (!calibration.ok()) {
    spdlog::error("calibration {}: cannot be read, tried again at the next start: {}", job.id,
                  std::string(calibration.status().message()));
    return;
  }
  if (absl::Status status = Begin(&*calibration); !status.ok()) {
    Fail(std::string(status.message()), &*calibration);
  } else {
    try {
      Solve(&*calibration);
    } catch (const std::exception& error) {
      Fail(absl::StrCat("an unexpected fault while solving: ", error.what()), &*calibration);
    }
  }
  bool cancelled = false;
  bool stopping = false;
  {
    std::lock_guard lock(mutex_);
    cancelled = cancel_asked_;
    stopping = stopping_;
  }
  if (cancelled) {
    Fail("cancelled", &*calibration);
  } else if (stopping && calibration->state != CalibrationState::kSucceeded) {
    // A clean stop is no failed attempt: begin anew at the next start.
    calibration->state = CalibrationState::kQueued;
    calibration->error.clear();
    calibration->refused.clear();
    calibration->start_utc_ns = 0;
  }
  calibration->progress_stage.clear();
  if (calibration->state != CalibrationState::kQueued) {
    calibration->end_utc_ns = UtcNowNs(options_.utc_now_ns);
  }
  End(*std::move(calibration));
}

absl::Status CalibrationRunner::Begin(Calibration* calibration) {
  const int attempt = AttemptOf(*calibration) + 1;
  if (attempt > options_.max_attempts) {
    return absl::InternalError(
        absl::StrCat("the server ended ", options_.max_attempts,
                     " times while it ran this calibration (out of memory?); use fewer "
                     "observations, or create it again"));
  }
  calibration->state = CalibrationState::kRunning;
  calibration->start_utc_ns = UtcNowNs(options_.utc_now_ns);
  calibration->progress_stage = absl::StrCat(kAttempt, attempt);
  if (absl::Status status = store_->UpdateCalibration(*calibration); !status.ok()) {
    return absl::Status(status.code(),
                        absl::StrCat("the calibration cannot be begun: ", status.message()));
  }
  changes_.Notify(calibration->id);
  return absl::OkStatus();
}

void CalibrationRunner::Solve(Calibration* calibration) {
  RefusalCounter refused;
  const absl::StatusOr<CalibrationInput> input = ReadCalibrationInput(
      *store_, calibration->session_ids, options_.max_observations, interrupted_, &refused);
  if (!input.ok()) {
    calibration->refused = refused.List();
    return Fail(absl::StrCat("the observations cannot be read: ", input.status().message()),
                calibration);
  }
  CalibrationHooks hooks;
  hooks.progress = [this](std::string_view stage, double fraction) {
    ReportProgress(stage, fraction);
  };
  hooks.cancelled = &interrupted_;
  const auto start = std::chrono::steady_clock::now();
  CalibrationOutcome outcome = calibrate_(*input, calibration->options, hooks);
  calibration->duration_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!outcome.result.ok()) {
    calibration->refused = std::move(outcome.refused);
    return Fail(std::string(outcome.result.status().message()), calibration);
  }
  calibration->state = CalibrationState::kSucceeded;
  calibration->progress_fraction = 1;
  calibration->result = *std::move(outcome.result);
}

void CalibrationRunner::End(Calibration calibration) {
  if (absl::Status status = store_->UpdateCalibration(calibration); !status.ok()) {
    spdlog::error("calibration {}: its end cannot be stored: {}", calibration.id,
                  std::string(status.message()));
    // The store still says that it is queued or running, so the next start tries again.
    if (calibration.state == CalibrationState::kSucceeded) {
      Fail(absl::StrCat("the result cannot be stored: ", status.message(),
                        "; it is calculated again when the server starts next"),
           &calibration);
    }
    std::lock_guard lock(mutex_);
    if (unsaved_.size() < kMaxUnsaved) unsaved_.insert_or_assign(calibration.id, calibration);
  }
  switch (calibration.state) {
    case CalibrationState::kSucceeded:
      spdlog::info("calibration {}: succeeded in {:.1f} s", calibration.id, calibration.duration_s);
      break;
    case CalibrationState::kFailed:
      spdlog::warn("calibration {}: failed: {}", calibration.id, calibration.error);
      break;
    default:
      spdlog::info("calibration {}: queued again for the next start", calibration.id);
  }
  changes_.Notify(calibration.id);
}

void CalibrationRunner::ReportProgress(std::string_view stage, double fraction) {
  std::string id;
  {
    std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    const bool due = stage != stage_ || now - last_notification_ >= options_.progress_interval;
    stage_ = stage;
    fraction_ = fraction;
    if (!due) return;
    last_notification_ = now;
    id = running_id_;
  }
  changes_.Notify(id);
}

}  // namespace rigcal::server
