// SPDX-License-Identifier: Apache-2.0
#include "server/session/retention.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kListPage = 200;

uint64_t UsedBytes(const StoreHealth& health) {
  return health.size_bytes - std::min(health.size_bytes, health.unused_bytes);
}

}  // namespace

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
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionSummary> candidates, Candidates());
  const int64_t now_utc_ns = UtcNowNs(options_.utc_now_ns);
  uint64_t deleted = 0;
  uint64_t kept = 0;
  for (const SessionSummary& candidate : candidates) {
    const std::string& id = candidate.session.id;
    const std::string why = DueText(candidate.session, now_utc_ns);
    if (why.empty()) continue;
    RIGCAL_ASSIGN_OR_RETURN(const bool calibrated, IsCalibrated(id));
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

absl::StatusOr<std::vector<SessionSummary>> Retention::Candidates() const {
  std::vector<SessionSummary> candidates;
  ListPage next{.order = RecordOrder::kOldestFirst, .limit = kListPage};
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(auto page,
                            store_->ListSessions({.state = SessionState::kFinished}, next));
    page_size = page.size();
    for (auto& [summary, position] : page) {
      next.after = position;
      if (summary.damage.empty() && summary.session.observations_delete_utc_ns == 0 &&
          summary.observation_count > 0) {
        candidates.push_back(std::move(summary));
      }
    }
  } while (page_size == static_cast<size_t>(kListPage));
  return candidates;
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
    const uint64_t used = UsedBytes(store_->Health());
    if (used > options_.max_bytes) {
      return absl::StrCat("the database has ", used >> 20, " MiB, and ", options_.max_bytes >> 20,
                          " MiB are kept");
    }
  }
  return "";
}

absl::StatusOr<bool> Retention::IsCalibrated(const std::string& session_id) const {
  ListPage next{.limit = kListPage};
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(const auto page,
                            store_->ListCalibrations({.session_id = session_id}, next));
    page_size = page.size();
    for (const auto& [calibration, position] : page) {
      next.after = position;
      if (calibration.state != CalibrationState::kFailed) return true;
    }
  } while (page_size == static_cast<size_t>(kListPage));
  return false;
}

RetentionStats Retention::Stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

}  // namespace rigcal::server
