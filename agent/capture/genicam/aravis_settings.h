// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "agent/capture/genicam/aravis_objects.h"
#include "agent/capture/genicam/aravis_options.h"
#include "common/camera/camera_description.h"

namespace rigcal::agent {

// Applies `options` to the camera, in an order in which no setting limits a later one. With PTP the
// camera's clock follows IEEE 1588, and must lock within 20 s. Errors list what the camera offers;
// settings made before the error remain.
absl::Status ApplySettings(ArvCamera* camera, const AravisSourceOptions& options);

// The camera's present settings; empty or 0 if it does not report one.
CameraSettings ReadSettings(ArvCamera* camera);

// Warnings about settings for a blinking wand: exposure shorter than a blink, automatic exposure,
// settings that the camera changed.
std::vector<std::string> SettingWarnings(ArvCamera* camera, const AravisSourceOptions& options,
                                         const CameraSettings& settings);

// INVALID_ARGUMENT: the camera's pixel format is not supported; lists the supported formats and
// those that the camera offers.
absl::Status CheckPixelFormat(ArvCamera* camera);

// The clock of PTP ("ptp-<grandmaster>", "ptp"), or empty if the camera's does not follow it.
std::string PtpClockId(ArvCamera* camera);

// Whether the camera has this GenICam feature; it may lack any of them.
inline bool FeatureIsAvailable(ArvCamera* camera, const char* feature) {
  GErrorSlot error;
  return arv_camera_is_feature_available(camera, feature, error.out()) && error.ok();
}

// The present exposure in seconds; 0: not known.
double ExposureSeconds(ArvCamera* camera);
bool ExposureIsAutomatic(ArvCamera* camera);

}  // namespace rigcal::agent
