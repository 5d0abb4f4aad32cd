// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/session/session.h"
#include "common/status/refusal.h"
#include "server/solve/calibrate.h"
#include "server/store/store.h"

namespace rigcal::server {

// Checks that these sessions may go into one calibration. FAILED_PRECONDITION names the session (or
// the two that differ) and the camera: not finished, another rig or target, other intrinsics or
// image size for the same camera, a camera without intrinsics.
absl::Status CheckSessionsFit(absl::Span<const Session> sessions);

// The observations of the sessions as input of the solver: one track per session and camera,
// without refused and late rows. `refused` gets what agents and ingest refused, and late rows as
// RefusalReason::kLate; also when reading fails.
//   CANCELLED           `cancelled` has become true
//   RESOURCE_EXHAUSTED  more than `max_observations`
// and the store's errors.
absl::StatusOr<CalibrationInput> ReadCalibrationInput(const Store& store,
                                                      absl::Span<const std::string> session_ids,
                                                      size_t max_observations,
                                                      const std::atomic<bool>& cancelled,
                                                      RefusalCounter* refused);

}  // namespace rigcal::server
