// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "common/calibration/calibration_options.h"
#include "common/status/refusal.h"
#include "server/solve/calibrate.h"
#include "server/solve/calibration_report.h"
#include "server/solve/rig/rig_observations.h"

namespace rigcal::server {

// What a calibration refuses before it solves anything. Every message names the camera, the reason
// and what to do.

// INVALID_ARGUMENT: options, targets or cameras that contradict each other or themselves.
absl::Status ValidateInput(const CalibrationInput& input, const CalibrationOptions& options);

// By camera, before anything is rejected.
std::map<std::string, CameraCounts> CountInput(const CalibrationInput& input);

// True: rows that were refused for it never came to the solve.
bool IsUnread(RefusalReason reason);

// FAILED_PRECONDITION: most rows of a camera were refused before the solve: the reason that refused
// most of them, with its example.
absl::Status CheckReadRows(const std::map<std::string, CameraCounts>& counts,
                           const std::vector<Refusal>& refused);

// FAILED_PRECONDITION: of a wand no camera ever saw two markers in one row.
absl::Status CheckMarkersTogether(const CalibrationInput& input);

// INVALID_ARGUMENT: many markers of a camera lie outside of the image that its description states,
// or all of them in its first pixels.
absl::Status CheckImageSizes(const std::vector<CameraTrack>& tracks);

// INVALID_ARGUMENT: one coordinate of a camera's marker is the same in all views, the other is not.
absl::Status CheckColumns(const std::vector<CameraTrack>& tracks);

// FAILED_PRECONDITION: fewer than two cameras, or one that never saw the wand. INVALID_ARGUMENT:
// the options name a camera that there is not.
absl::Status CheckCameras(const std::map<std::string, CameraCounts>& counts,
                          const CalibrationOptions& options);

// FAILED_PRECONDITION: a camera of which nothing is left after cleaning and aligning, but for those
// that were left out.
absl::Status CheckTracks(const RigIndex& index, const std::map<std::string, CameraCounts>& counts,
                         const std::set<std::string>& left_out);

// FAILED_PRECONDITION: a camera in whose image the wand stayed at one place, or with a handful of
// views.
absl::Status CheckMotion(const RigObservations& rig,
                         const std::map<std::string, CameraCounts>& counts);

}  // namespace rigcal::server
