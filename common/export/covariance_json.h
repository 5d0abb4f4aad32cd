// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace rigcal {

// The JSON of a calibration with the joint covariance of its cameras
// (CalibrationResult::camera_covariance) as one more field, "camera_covariance", a list of numbers.
// `json` is an object, as of the format "json". Nothing is added without a covariance, nor where it
// holds what is no number.
std::string WithCameraCovariance(std::string json, const std::vector<double>& packed);

}  // namespace rigcal
