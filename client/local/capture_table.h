// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/local/local_calibration.h"
#include "client/local/local_rig.h"

namespace rigcal::client {

// One line of progress while a session captures: observations delivered per camera, or in total for
// many cameras; with the percentage where every camera's expected count is known.
std::string FormatCaptureProgress(const v1::Session& session,
                                  const std::vector<LocalCamera>& cameras);

// Observations delivered and used per camera. `duration_s`: of the wave, for rates; 0: not known.
std::string FormatCapture(const LocalOutcome& outcome, double duration_s);

}  // namespace rigcal::client
