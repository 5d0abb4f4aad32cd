// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tests/accuracy/rig/rig_covariance.h"

namespace rigcal::accuracy {

// Free-running cameras of 50, 60 and 120 frames per second with random phases, jitter, clock
// offsets, and a fast wand.
struct ClocksOptions {
  int camera_count = 6;
  double duration_s = 60;
  double jitter_s = 20e-6;
  double wand_speed_m_s = 2;
  double largest_offset_s = 0.5;  // uniform in +-
  double largest_rate_ppm = 0;    // uniform in +-
  bool free_running = true;       // else 50 fps, exposed together
  bool clock_samples = false;     // clocks of unknown origin, aligned by samples only
};

struct ClockError {
  std::string camera;
  double offset_s = 0;  // against the median clock
  double rate_ppm = 0;  // likewise
  // Sigmas of the offset: from the result, and relative to the reference's clock from the
  // covariance; 0: not computed.
  double stated_sigma_s = 0;
  double offset_against_reference_s = 0;
  double covariance_sigma_s = 0;
};

struct ClocksTrial {
  absl::Status status;
  std::vector<ClockError> clocks;
  double position_rms_m = 0;
  std::optional<RigNees> stated;
};

ClocksTrial RunClocksTrial(const ClocksOptions& options, uint32_t seed);

}  // namespace rigcal::accuracy
