// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

// Which observations to delete: by age, by size, or both.
struct PruneOptions {
  std::string rig;                  // empty: of every rig
  int64_t max_age_ns = 0;           // since the session finished; 0: no limit
  uint64_t max_bytes = 0;           // of the database; 0: no limit
  bool include_calibrated = false;  // also what a calibration was made from
  bool dry_run = false;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

struct PrunedSession {
  std::string id;
  uint64_t observation_count = 0;
  std::string reason;  // why it is due
  std::string kept;    // why it was kept nevertheless; empty: deleted, or would be
};

// Deletes the observations of finished sessions that are due, oldest first, and gives the space
// back to the disk. With `dry_run` the size of a session is taken as its share of all observations.
// INVALID_ARGUMENT: no limit is given. FAILED_PRECONDITION: a size, for a store that does not count
// its unused space. Errors of the store.
absl::StatusOr<std::vector<PrunedSession>> PruneSessions(const PruneOptions& options, Store* store,
                                                         SessionCoordinator* coordinator);

// Of the database, unused space left out.
uint64_t UsedStoreBytes(const Store& store);

// Finished sessions of a rig (empty: of every rig) that have observations, oldest first.
absl::StatusOr<std::vector<SessionSummary>> FinishedSessions(const Store& store,
                                                             const std::string& rig);

// Whether a calibration that has not failed was made from a session.
absl::StatusOr<bool> IsCalibrated(const Store& store, const std::string& session_id);

}  // namespace rigcal::server
