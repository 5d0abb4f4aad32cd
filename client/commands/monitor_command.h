// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/commands/command_context.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

struct MonitorOptions {
  std::string rig;
  std::string session = {};  // empty: what the server's monitor says
  std::string against = {};  // empty: the active calibration
  bool repair = false;       // and activate the result if it is good
};

// Without a session: what the server's own monitor has found. kOk, unless a camera has moved.
//
// `rigcal monitor`: solves a short session with the intrinsics of the active calibration and says
// which cameras have moved, and whose clocks have stepped. kOk: all are where they were, or were
// repaired; kCameraMoved: one has moved, or it cannot be told.
ExitCode Monitor(const MonitorOptions& options, CommandContext& context);

// `rigcal rig monitor`: switches the server's monitor.
struct MonitorModeOptions {
  std::string rig;
  std::string mode;  // "off", "watch", "repair"; empty: what it is
};
ExitCode SetMonitorMode(const MonitorModeOptions& options, CommandContext& context);

// Cameras whose clocks have stepped against the others by more than `kClockSigmas`, in words.
std::vector<std::string> SteppedClocks(const rigcal::v1::CompareCalibrationsResponse& difference);

}  // namespace rigcal::client
