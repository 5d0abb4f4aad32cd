// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/calibration/calibration_record.h"
#include "server/audit/audit_log.h"
#include "server/live/live_state.h"
#include "server/session/calibration_runner.h"
#include "server/session/rig_book.h"
#include "server/store/store.h"

namespace rigcal::server {

struct CameraRepairsOptions {
  double least_repair_s = 5;                 // recorded after a move, for a repair
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// A repair that is being solved.
struct CameraRepair {
  std::string id, parent_id;  // calibrations: its own, and the one that it repairs
  std::vector<std::string> cameras;
};

// Repairs of cameras that a monitor has seen to have moved: a derived calibration from what was
// recorded after the move, queued as any other, and made active only if it is graded good and
// nobody has activated another one meanwhile. What becomes of it is written into the state that is
// shown (repair, repair_id, repair_text), into the log and that of audits.
//
// For the monitor's thread only.
class CameraRepairs {
 public:
  // All must outlive it; `audit` null: nothing is written.
  CameraRepairs(CameraRepairsOptions options, Store* store, CalibrationRunner* runner,
                AuditLog* audit);

  // Of the cameras that `shown` says have moved since the session began, by its rows from
  // `clean_from_s` (0: all of it is behind the move) to its end at `duration_s`. None: there is
  // nothing to repair, or it cannot be, and `shown` says why.
  std::optional<CameraRepair> Begin(const std::string& rig, const Session& session,
                                    double clean_from_s, double duration_s, LiveMonitor* shown);
  // Activates what is solved, if it may. True: the repair has ended, one way or the other.
  bool Follow(const std::string& rig, const CameraRepair& repair, LiveMonitor* shown);

 private:
  void End(const std::string& rig, const CameraRepair& repair, const Calibration& calibration,
           LiveMonitor* shown);
  void Audit(const std::string& rig, const CameraRepair& repair, const std::string& what) const;

  const CameraRepairsOptions options_;
  Store* const store_;
  CalibrationRunner* const runner_;
  AuditLog* const audit_;
  RigBook book_;
};

}  // namespace rigcal::server
