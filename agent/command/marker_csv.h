// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/target/observation.h"

namespace rigcal::agent {

// `timestamp_ns;x0;y0;x1;y1;...` in pixels with the end of the line; -1;-1 for a marker that is not
// seen. What csv: reads.
std::string MarkerCsvLine(const Observation& observation);

}  // namespace rigcal::agent
