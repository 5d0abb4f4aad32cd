// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

// Calibrations as people read them: millimetres and degrees where that is what one looks for.

// "bundle adjustment 40 %", in one line.
std::string FormatCalibrationProgress(const rigcal::v1::Calibration& calibration);
std::string FormatCalibrationList(const rigcal::v1::ListCalibrationsResponse& response);
// Everything of one: residuals, poses, instants, wand, refusals, findings, quality.
std::string FormatCalibration(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
