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
#include "common/camera/camera_description.h"

namespace rigcal::agent {

// Applies `options` to the camera, in an order in which no setting limits a later one, and waits
// for PTP if requested. Errors begin with the camera's name and list what the camera offers;
// settings made before the error remain.
absl::Status ApplySettings(ArvCamera* camera, const AravisSourceOptions& options);

// The camera's present settings; empty or 0 if it does not report one.
CameraSettings ReadSettings(ArvCamera* camera);

// Warnings about settings for a blinking wand: exposure shorter than a blink, automatic exposure,
// settings that the camera changed. Each begins with the camera's name.
std::vector<std::string> SettingWarnings(ArvCamera* camera, const AravisSourceOptions& options,
                                         const CameraSettings& settings);

// The paper's rule: an exposure must not be shorter than one blink period. None: it is not, or one
// of the two is not known (0).
std::optional<std::string> ShortExposureWarning(const std::string& camera, double exposure_s,
                                                double blink_hz);

// The camera's pixel format. INVALID_ARGUMENT: not supported; lists the supported formats and those
// that the camera offers.
absl::StatusOr<GenicamPixelFormat> CurrentPixelFormat(ArvCamera* camera, const std::string& name);

// The present exposure in seconds; 0: not known.
double ExposureSeconds(ArvCamera* camera);
bool ExposureIsAutomatic(ArvCamera* camera);

}  // namespace rigcal::agent
