// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace rigcal::accuracy {

// Cameras without a common clock, started by hand at times of their own while a wand is waved.
struct StartsOptions {
  int camera_count = 6;
  double duration_s = 90;      // of each camera's recording
  double latest_start_s = 60;  // the first camera's start is 0 or later
  double slowest_hz = 24, fastest_hz = 60;
  double wand_speed_m_s = 1.5;
  double jitter_s = 20e-6;
  bool is_point = false;  // the target has one marker
};

struct StartsRun {
  absl::Status status;
  double worst_offset_s = 0;  // error against the median clock
  double position_rms_m = 0;  // of a wand; 0 of a point, whose scale is not known
  double cpu_s = 0;           // of the whole calibration
};

struct StartsTrial {
  StartsRun aligned;  // the same rows with stamps of one clock
  StartsRun started;  // every camera's stamps begin at its own start
};

StartsTrial RunStartsTrial(const StartsOptions& options, uint32_t seed);

}  // namespace rigcal::accuracy
