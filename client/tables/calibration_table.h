// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

// Calibrations as people read them: millimetres and degrees where that is what one looks for.

// "bundle adjustment 40 %", in one line.
std::string FormatCalibrationProgress(const rigcal::v1::Calibration& calibration);
std::string FormatCalibrationList(const rigcal::v1::ListCalibrationsResponse& response);
// "expected error     0.29 mm + 0.69 % of every length ...", and the reprojection error; empty:
// none.
std::string FormatHeadlineFigures(const rigcal::v1::Calibration& calibration);
// Everything of one: grade and headline, residuals, poses, instants, wand, refusals, findings.
std::string FormatWholeCalibration(const rigcal::v1::Calibration& calibration);
// The same, of a large rig without the cameras that need nothing (notable_cameras.h).
std::string FormatCalibration(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
