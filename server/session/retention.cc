// SPDX-License-Identifier: Apache-2.0
#include "server/session/retention.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/prune.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
Retention::Retention(RetentionOptions options, Store* store, SessionCoordinator* coordinator)
    : options_(std::move(options)), store_(store), coordinator_(coordinator) {}

void Retention::Start() {
  if (!enabled()) return;
  tasks_.Post([this] { RunAndPlanNext(); });
  tasks_.Start();
}

void Retention::RunAndPlanNext() {
  Run().IgnoreError();  // noted in the statistics
  tasks_.PostAt(std::chrono::steady_clock::now() + options_.interval, [this] { RunAndPlanNext(); });
}

absl::Status Retention::Run() {
  const absl::Status status = DeleteDue();
  if (!status.ok()) spdlog::warn("retention: {}", std::string(status.message()));
  const std::lock_guard lock(mutex_);
  stats_.last_run_utc_ns = UtcNowNs(options_.utc_now_ns);
  stats_.problem = std::string(status.message());
  return status;
}

absl::Status Retention::DeleteDue() {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionSummary> candidates,
                          FinishedSessions(*store_, ""));
  const int64_t now_utc_ns = UtcNowNs(options_.utc_now_ns);
  uint64_t deleted = 0;
  uint64_t kept = 0;
  for (const SessionSummary& candidate : candidates) {
    const std::string& id = candidate.session.id;
    const std::string why = DueText(candidate.session, now_utc_ns);
    if (why.empty()) continue;
    RIGCAL_ASSIGN_OR_RETURN(const bool calibrated, IsCalibrated(*store_, id));
    if (calibrated && !options_.delete_calibrated) {
      ++kept;
      continue;
    }
    const absl::Status status = coordinator_->DeleteObservations(id);
    // Somebody is reading it, or has deleted it: the next time.
    if (absl::IsFailedPrecondition(status) || absl::IsNotFound(status)) continue;
    RIGCAL_RETURN_IF_ERROR(status);
    ++deleted;
    spdlog::info("retention: deleted the {} observations of session {}: {}",
                 candidate.observation_count, id, why);
    const std::lock_guard lock(mutex_);
    ++stats_.session_count;
    stats_.last_session_id = id;
  }
  {
    const std::lock_guard lock(mutex_);
    stats_.kept_session_count = kept;
  }
  if (deleted == 0) return absl::OkStatus();
  return store_->Compact([](double) { return absl::OkStatus(); });
}

std::string Retention::DueText(const Session& session, int64_t now_utc_ns) const {
  if (options_.max_age.count() > 0) {
    const std::chrono::nanoseconds age(now_utc_ns - session.finish_utc_ns);
    if (age > options_.max_age) {
      constexpr int64_t kHoursPerDay = 24;
      return absl::StrCat(
          "it finished ",
          std::chrono::duration_cast<std::chrono::hours>(age).count() / kHoursPerDay,
          " days ago, and they are kept for ", options_.max_age.count() / kHoursPerDay);
    }
  }
  if (options_.max_bytes > 0) {
    const uint64_t used = UsedStoreBytes(*store_);
    if (used > options_.max_bytes) {
      return absl::StrCat("the database has ", used >> 20, " MiB, and ", options_.max_bytes >> 20,
                          " MiB are kept");
    }
  }
  return "";
}

RetentionStats Retention::Stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

}  // namespace rigcal::server
