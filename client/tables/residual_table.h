// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

// A line for each camera: counts, the figures of the used markers as the calibration has them, the
// mean vector, and the histogram as a row of characters.
std::string FormatResiduals(const rigcal::v1::GetResidualsResponse& residuals,
                            const rigcal::v1::Calibration& calibration);

}  // namespace rigcal::client
