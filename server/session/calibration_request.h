// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/calibration/calibration_record.h"
#include "common/session/session.h"
#include "server/store/store.h"

namespace rigcal::server {

// The steps from what a client asks for to a calibration that can be queued: which sessions it
// uses, in which frame it ends, and what follows from its parent. All of them may also return the
// store's errors.

// INVALID_ARGUMENT: the sessions that a client names are none (for a solve), too many, or one
// twice.
absl::Status CheckNamedSessions(absl::Span<const std::string> session_ids,
                                const CalibrationOptions& options);

// The sessions named, and behind them, unless it is a repair, those that they continue, and that
// those continue; without `without_sessions` of the options, which are empty then.
// INVALID_ARGUMENT: a solve has none left.
absl::StatusOr<std::vector<std::string>> SessionsToUse(const Store& store,
                                                       std::vector<std::string> session_ids,
                                                       CalibrationOptions* options);

// Decides in which frame a full solve ends: that of the active calibration, if it has one of its
// own, unless the options say otherwise. FAILED_PRECONDITION: it is to be kept, and none is active.
absl::Status ChooseFrame(const Store& store, const std::string& rig, CalibrationOptions* options);

// Of the options; none for kinds without one. An error: it is needed, and cannot be read.
absl::StatusOr<std::optional<Calibration>> ParentOf(const Store& store,
                                                    const CalibrationOptions& options);

// Fills what follows from the options and their parent. Errors as of CheckDerivation.
absl::Status Derive(const Store& store, absl::Span<const Session> sessions,
                    Calibration* calibration);

}  // namespace rigcal::server
