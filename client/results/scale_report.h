// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/scale/scale_fusion.h"

namespace rigcal::client {

// What `rigcal calibration scale` came to.
struct ScaleReport {
  std::string calibration;
  std::string output;  // file; empty: nothing was written
  ScaleFusion fusion;
};

std::string FormatScale(const ScaleReport& report);
std::string ToJson(const ScaleReport& report);

}  // namespace rigcal::client
