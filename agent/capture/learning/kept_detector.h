// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/status.h"
#include "agent/capture/detector_control.h"

namespace rigcal::agent {

// What was learnt for a camera, in files of the agent's state directory: CAMERA.json with the
// colour, CAMERA.png with the mask, white where pixels are ignored. A file that is not there means
// that nothing was learnt. `folder` empty: nothing is kept.

// Replaces the files, each at once. Errors of the file system name the path.
absl::Status KeepDetector(const std::filesystem::path& folder, const DetectorControl& detector);

// Sets what the files hold. INVALID_ARGUMENT: a file is damaged, or the mask is not of the camera's
// size; the other one counts.
absl::Status RestoreDetector(const std::filesystem::path& folder, DetectorControl* detector);

}  // namespace rigcal::agent
