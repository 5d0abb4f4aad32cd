// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <google/protobuf/repeated_ptr_field.h>

#include <string>

#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// Calibrations as people read them: millimetres and degrees where that is what one looks for.

std::string CalibrationStateName(rigcal::v1::Calibration::State state);
// "bundle adjustment 40 %", in one line.
std::string FormatCalibrationProgress(const rigcal::v1::Calibration& calibration);
std::string FormatCalibrationList(
    const google::protobuf::RepeatedPtrField<rigcal::v1::Calibration>& calibrations);
// Everything of one: residuals, poses, instants, wand, refusals, findings, quality.
std::string FormatCalibration(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
