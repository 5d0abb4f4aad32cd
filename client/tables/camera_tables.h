// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration.pb.h"

namespace rigcal::client {

// A calibration's cameras as people read them, a line for each, in millimetres, degrees,
// milliseconds and pixels. A table that would have no line is an empty text.

std::string FormatCameraResiduals(const rigcal::v1::Calibration& calibration);
// Centres and orientations in the rig frame, and the clocks.
std::string FormatCameraPoses(const rigcal::v1::Calibration& calibration);
// One sigma of each pose and clock, with a headline.
std::string FormatCameraUncertainty(const rigcal::v1::Calibration& calibration);
// Errors on what was not used for the solve, with a headline.
std::string FormatHeldOutErrors(const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
