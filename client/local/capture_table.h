// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/local/local_calibration.h"
#include "client/local/local_rig.h"

namespace rigcal::client {

// One line about a session that captures: how many observations each camera has delivered, or, of
// many cameras, all together; the share of what is expected, where that is known of all.
std::string FormatCaptureProgress(const v1::Session& session,
                                  const std::vector<LocalCamera>& cameras);

// What each camera delivered and what of it the calibration uses. `duration_s`: of the wave, which
// gives rates; 0: not known.
std::string FormatCapture(const LocalOutcome& outcome, double duration_s);

}  // namespace rigcal::client
