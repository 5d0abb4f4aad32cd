// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "agent/capture/genicam/aravis_objects.h"

namespace rigcal::agent {

// Makes the camera's clock follow IEEE 1588 and waits until it has locked. `prefix` begins errors:
// INVALID_ARGUMENT: the camera has no PTP. UNAVAILABLE: it did not lock in time.
absl::Status SwitchPtpOn(ArvCamera* camera, const std::string& prefix);

// The clock of PTP ("ptp-<grandmaster>", "ptp"), or empty if it does not.
std::string PtpClockId(ArvCamera* camera);

}  // namespace rigcal::agent
