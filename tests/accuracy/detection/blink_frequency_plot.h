// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/accuracy/detection/blink_frequency_experiment.h"

namespace rigcal::accuracy {

// Draws the rates of wands and of markers against the blink frequency as a PNG file. UNAVAILABLE:
// the file cannot be written.
absl::Status DrawBlinkFrequency(const BlinkFrequencyOptions& options,
                                const std::vector<BlinkFrequencyPoint>& points,
                                const std::string& png_path);

}  // namespace rigcal::accuracy
