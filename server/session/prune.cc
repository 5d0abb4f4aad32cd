// SPDX-License-Identifier: Apache-2.0
#include "server/session/prune.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/status/status_macros.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

constexpr int kPageSize = 200;
constexpr double kNsPerDay = 86'400e9;

std::string DueReason(const PruneOptions& options, const SessionSummary& session, int64_t now_ns,
                      uint64_t used_bytes) {
  const int64_t age_ns = now_ns - session.session.finish_utc_ns;
  if (options.max_age_ns > 0 && age_ns >= options.max_age_ns) {
    return absl::StrFormat("it finished %.1f days ago", static_cast<double>(age_ns) / kNsPerDay);
  }
  if (options.max_bytes > 0 && used_bytes > options.max_bytes) {
    return absl::StrCat("the database has ", (used_bytes + (1 << 20) - 1) >> 20, " MiB");
  }
  return "";
}

}  // namespace

uint64_t UsedStoreBytes(const Store& store) {
  const StoreHealth health = store.Health();
  return health.size_bytes - std::min(health.size_bytes, health.unused_bytes);
}

absl::StatusOr<std::vector<SessionSummary>> FinishedSessions(const Store& store,
                                                             const std::string& rig) {
  std::vector<SessionSummary> sessions;
  ListPage next{.order = RecordOrder::kOldestFirst, .limit = kPageSize};
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(
        auto page, store.ListSessions({.rig = rig, .state = SessionState::kFinished}, next));
    page_size = page.size();
    for (auto& [summary, position] : page) {
      next.after = position;
      if (summary.damage.empty() && summary.session.observations_delete_utc_ns == 0 &&
          summary.observation_count > 0) {
        sessions.push_back(std::move(summary));
      }
    }
  } while (page_size == static_cast<size_t>(kPageSize));
  return sessions;
}

absl::StatusOr<bool> IsCalibrated(const Store& store, const std::string& session_id) {
  ListPage next{.limit = kPageSize};
  size_t page_size = 0;
  do {
    RIGCAL_ASSIGN_OR_RETURN(const auto page,
                            store.ListCalibrations({.session_id = session_id}, next));
    page_size = page.size();
    for (const auto& [calibration, position] : page) {
      next.after = position;
      if (calibration.state < CalibrationState::kFailed) return true;
    }
  } while (page_size == static_cast<size_t>(kPageSize));
  return false;
}

absl::StatusOr<std::vector<PrunedSession>> PruneSessions(const PruneOptions& options, Store* store,
                                                         SessionCoordinator* coordinator) {
  if (options.max_age_ns <= 0 && options.max_bytes == 0) {
    return absl::InvalidArgumentError(
        "nothing says which sessions to prune; give an age (older_than), a size (max_bytes) or "
        "both");
  }
  const bool counts_unused = store->Health().counts_unused;
  if (options.max_bytes > 0 && !counts_unused) {
    return absl::FailedPreconditionError(
        "sessions are not pruned by size: this server's database is elsewhere, and does not tell "
        "how much of it is unused; prune by age (older_than, retention.max_age_days)");
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionSummary> sessions,
                          FinishedSessions(*store, options.rig));
  const int64_t now_ns = UtcNowNs(options.utc_now_ns);
  uint64_t used_bytes = UsedStoreBytes(*store);
  uint64_t row_count = 0;
  for (const SessionSummary& session : sessions) row_count += session.observation_count;
  const double row_bytes =
      static_cast<double>(used_bytes) / static_cast<double>(std::max<uint64_t>(1, row_count));
  std::vector<PrunedSession> pruned;
  bool deleted = false;
  for (const SessionSummary& session : sessions) {
    PrunedSession entry{session.session.id, session.observation_count,
                        DueReason(options, session, now_ns, used_bytes), ""};
    if (entry.reason.empty()) continue;
    RIGCAL_ASSIGN_OR_RETURN(const bool calibrated, IsCalibrated(*store, entry.id));
    if (calibrated && !options.include_calibrated) {
      entry.kept = "a calibration was made from it";
    } else if (options.dry_run) {
      used_bytes -= std::min(
          used_bytes,
          static_cast<uint64_t>(row_bytes * static_cast<double>(session.observation_count)));
    } else {
      const absl::Status status = coordinator->DeleteObservations(entry.id);
      if (absl::IsFailedPrecondition(status)) {
        entry.kept = std::string(status.message());
      } else if (!absl::IsNotFound(status)) {
        RIGCAL_RETURN_IF_ERROR(status);
        deleted = true;
        used_bytes = UsedStoreBytes(*store);
        spdlog::info("prune: deleted the {} observations of session {}: {}",
                     entry.observation_count, entry.id, entry.reason);
      }
    }
    pruned.push_back(std::move(entry));
  }
  if (deleted && counts_unused) {
    RIGCAL_RETURN_IF_ERROR(store->Compact([](double) { return absl::OkStatus(); }));
  }
  return pruned;
}

}  // namespace rigcal::server
