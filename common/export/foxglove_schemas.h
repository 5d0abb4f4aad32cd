// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal {

// JSON schemas of two of Foxglove's messages (its documentation, "Schemas").
std::string FoxgloveCameraCalibrationSchema();
std::string FoxgloveFrameTransformsSchema();

}  // namespace rigcal
