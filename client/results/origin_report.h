// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/origin/origin.h"

namespace rigcal::client {

// What `rigcal calibration origin` came to.
struct OriginReport {
  std::string calibration;
  std::string output;  // file
  OriginSolution solution;
};

std::string FormatOrigin(const OriginReport& report);
std::string ToJson(const OriginReport& report);

}  // namespace rigcal::client
