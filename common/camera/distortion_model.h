// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace rigcal {

// Lens distortion models, with OpenCV's meaning and order of coefficients.
enum class DistortionModel : uint8_t {
  kBrownConrady = 1,  // k1 k2 p1 p2 k3 (OpenCV "plumb_bob")
  kRational = 2,      // k1 k2 p1 p2 k3 k4 k5 k6
  kFisheye = 3,       // equidistant k1 k2 k3 k4 (OpenCV's fisheye module)
};

// Number of coefficients of a model: 5, 8 or 4.
int CoefficientCount(DistortionModel model);
// "plumb_bob", "rational_polynomial", "equidistant": the words calibration files use.
std::string_view DistortionModelName(DistortionModel model);

}  // namespace rigcal
