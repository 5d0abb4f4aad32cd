// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "rigcal/v1/status_service.pb.h"

namespace rigcal::client {

// A line for each process that solves calibrations. `now_s`: seconds since 1970, for how long ago
// a worker was heard of.
std::string FormatWorkerList(const v1::GetStatusResponse& status, int64_t now_s);

}  // namespace rigcal::client
