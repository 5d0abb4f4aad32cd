// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "common/calibration/calibration_record.h"
#include "common/session/session.h"

namespace rigcal::server {

// Whether a calibration of these sessions (of a new frame or scale: one or none) can derive from
// `parent` (null: it has none), as far as that is known before it is solved. FAILED_PRECONDITION:
// the parent is of another rig, has no result, is a what-if or graded bad, or has cameras that took
// no part in the sessions; intrinsics are for another image size. INVALID_ARGUMENT: a camera that
// the options name is in no session.
absl::Status CheckDerivation(const CalibrationOptions& options, absl::Span<const Session> sessions,
                             const Calibration* parent);

// Calibration::held.
std::vector<std::string> HeldBy(const CalibrationOptions& options,
                                absl::Span<const Session> sessions, const Calibration* parent);

}  // namespace rigcal::server
