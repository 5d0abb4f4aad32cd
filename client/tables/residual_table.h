// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "rigcal/v1/calibration_service.pb.h"

namespace rigcal::client {

// A line for each camera: counts, median and 95th percentile of the used markers' residuals (upper
// ends of their bins, pixels), the mean vector, and the histogram as a row of characters.
std::string FormatResiduals(const rigcal::v1::GetResidualsResponse& residuals);

}  // namespace rigcal::client
