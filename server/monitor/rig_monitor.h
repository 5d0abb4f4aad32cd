// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "common/calibration/calibration_record.h"
#include "server/audit/audit_log.h"
#include "server/live/live_state.h"
#include "server/monitor/camera_repairs.h"
#include "server/session/calibration_runner.h"
#include "server/session/calibration_solver.h"
#include "server/session/monitor_settings.h"
#include "server/session/session_coordinator.h"
#include "server/store/store.h"

namespace rigcal::server {

struct RigMonitorOptions {
  std::chrono::milliseconds poll_interval{500};
  double first_look_s = 8;  // after the start of a session
  double look_interval_s = 10;
  double window_s = 20;       // of a look while the session captures
  double least_repair_s = 5;  // recorded after a move, for a repair
  size_t max_observations = 10'000'000;
  std::function<int64_t()> utc_now_ns = {};  // unset: the system's clock
};

// What a monitor works with; all must outlive it.
struct RigMonitorParts {
  Store* store = nullptr;
  SessionCoordinator* coordinator = nullptr;
  CalibrationRunner* runner = nullptr;
  const MonitorSettings* settings = nullptr;
  AuditLog* audit = nullptr;  // null: nothing is written
  SolveFunction look;         // solves what is looked at; not the runner's queue
  std::function<void(const std::string& rig, LiveMonitor)> show;
};

// Compares the sessions of monitored rigs with their active calibrations: every few seconds while
// one captures, the last seconds of it; and when one has finished, the rest. A look is a solve with
// the lenses of the calibration and of nothing that is kept, compared by CompareRigs. Cameras that
// have moved are repaired where that is asked for: a derived calibration from what was recorded
// after the move, made active only if it is graded good and nobody has activated another one
// meanwhile.
//
// One look at a time, on one thread.
class RigMonitor {
 public:
  RigMonitor(RigMonitorOptions options, RigMonitorParts parts);
  ~RigMonitor() { Shutdown(); }

  void Start();
  // Ends the look that runs.
  void Shutdown();
  // Does what is due for every rig, in the caller's thread. Called by the monitor's own thread; by
  // tests instead of Start.
  void Step();

 private:
  struct Rig {
    LiveMonitor shown;
    int64_t since_utc_ns = 0;                 // sessions that finished before are not looked at
    std::optional<CalibrationResult> active;  // of shown.calibration_id
    std::set<std::string> ended;              // sessions that were looked at to their end
    std::optional<CameraRepair> repair;       // being solved
    // Of the session that is looked at.
    std::string session_id;
    int look_count = 0;
    double last_look_s = 0;
    double clean_from_s = 0;  // nothing has moved since
    std::set<std::string> seen_good;
    std::optional<CalibrationResult> first_look;
  };

  void Run();
  void StepRig(const std::string& name, MonitorMode mode, Rig* rig);
  absl::Status TakeActive(const std::string& name, Rig* rig);
  void Follow(const Session& session, Rig* rig);
  std::optional<Session> CapturingSession(const std::string& name) const;
  // Finished since the rig is monitored, not yet looked at to the end; oldest first.
  std::vector<Session> FinishedSessions(const std::string& name, const Rig& rig) const;
  // At what has been recorded from a time of the session on.
  void Look(const Session& session, double from_s, double now_s, Rig* rig);
  void LookAtEnd(const std::string& name, const Session& session, Rig* rig);

  const RigMonitorOptions options_;
  const RigMonitorParts parts_;
  CameraRepairs repairs_;
  std::map<std::string, Rig> rigs_;  // of the monitor's thread
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::thread thread_;
};

}  // namespace rigcal::server
