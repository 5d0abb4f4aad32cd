// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "client/local/local_command.h"
#include "client/local/local_rig.h"
#include "client/local/stop_signal.h"
#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/session.pb.h"

namespace rigcal::client {

struct LocalOutcome {
  rigcal::v1::Session session;  // finished
  double capture_s = 0;         // how long that took
  rigcal::v1::Calibration calibration;
  std::vector<double> camera_covariance;  // empty: not known
};

// Starts `rig`, captures one session with these cameras and calibrates from that; shows progress.
// The returned calibration has succeeded or failed. CANCELLED: by a signal. ABORTED: a process
// died; with the last lines of its log. DEADLINE_EXCEEDED: no progress; names what is missing.
absl::StatusOr<LocalOutcome> CalibrateLocally(const LocalOptions& options,
                                              const std::vector<LocalCamera>& cameras,
                                              LocalRig& rig, const StopSignals& signals,
                                              Console& console);

}  // namespace rigcal::client
