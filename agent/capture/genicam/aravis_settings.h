// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "agent/capture/genicam/aravis_objects.h"
#include "agent/capture/genicam/aravis_options.h"
#include "agent/capture/genicam/aravis_pixel_formats.h"
#include "common/camera/camera_settings.h"

namespace rigcal::agent {

// Puts what `options` give on the camera, in an order in which no setting limits a later one, and
// waits for PTP if that is asked. Errors begin with the camera's name, say what the camera offers
// instead, and leave what was set before.
absl::Status ApplySettings(ArvCamera* camera, const AravisSourceOptions& options);

// As the camera has them now. What it does not say stays empty or 0.
CameraSettings ReadSettings(ArvCamera* camera);

// What a person should know about these settings for a wand that blinks: exposure shorter than a
// blink, automatic exposure, settings that the camera changed. Each begins with the camera's name.
std::vector<std::string> SettingWarnings(ArvCamera* camera, const AravisSourceOptions& options,
                                         const CameraSettings& settings);

// The paper's rule: an exposure must not be shorter than one period of the wand's blinking. None:
// it is not, or one of the two is not known (0).
std::optional<std::string> ShortExposureWarning(const std::string& camera, double exposure_s,
                                                double blink_hz);

// The camera's pixel format. INVALID_ARGUMENT: not supported; lists what is, and what of it the
// camera offers.
absl::StatusOr<GenicamPixelFormat> CurrentPixelFormat(ArvCamera* camera, const std::string& name);

// Seconds of the exposure that is set now; 0: the camera does not say.
double ExposureSeconds(ArvCamera* camera);
bool ExposureIsAutomatic(ArvCamera* camera);

}  // namespace rigcal::agent
