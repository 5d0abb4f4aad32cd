// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/accuracy/detection/ambient_light_experiment.h"

namespace rigcal::accuracy {

// Draws detection rate against ambient light, a curve for each case, as a PNG file. UNAVAILABLE:
// the file cannot be written.
absl::Status DrawAmbientLight(const std::vector<AmbientLightPoint>& points,
                              const std::string& png_path);

}  // namespace rigcal::accuracy
