// SPDX-License-Identifier: Apache-2.0
#include "server/session/job_heartbeat.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kInterval = kJobLease / 3;
// A new stage is told at once, and not more often than this.
constexpr std::chrono::milliseconds kShortestInterval{250};

}  // namespace

JobHeartbeat::JobHeartbeat(Store* store, JobClaim claim, Events events)
    : store_(store), claim_(std::move(claim)), events_(std::move(events)) {
  thread_ = std::thread([this] { Run(); });
}

JobHeartbeat::~JobHeartbeat() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void JobHeartbeat::Report(const JobProgress& progress) {
  const std::lock_guard lock(mutex_);
  if (progress.stage != progress_.stage || progress.not_responding != progress_.not_responding) {
    is_due_ = true;
    wake_.notify_all();
  }
  progress_ = progress;
}

void JobHeartbeat::Run() {
  std::unique_lock lock(mutex_);
  bool is_away = false;
  while (true) {
    wake_.wait_for(lock, kShortestInterval, [this] { return stopping_; });
    wake_.wait_for(lock, kInterval - kShortestInterval, [this] { return stopping_ || is_due_; });
    if (stopping_) return;
    is_due_ = false;
    const JobProgress progress = progress_;
    lock.unlock();
    const absl::StatusOr<bool> cancel = store_->RenewJob(claim_, progress);
    if (absl::IsAborted(cancel.status())) {
      events_.lost(cancel.status());
      return;
    }
    if (!cancel.ok() && !is_away) {
      spdlog::warn("calibration {}: no heartbeat, the solve goes on: {}", claim_.calibration_id,
                   std::string(cancel.status().message()));
    } else if (cancel.ok() && is_away) {
      spdlog::info("calibration {}: heartbeats again", claim_.calibration_id);
    }
    is_away = !cancel.ok();
    if (cancel.ok() && *cancel) events_.cancel();
    lock.lock();
  }
}

}  // namespace rigcal::server
