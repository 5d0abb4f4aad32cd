// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/calibration/calibration.h"

namespace rigcal::server {

// A camera has seen a period of lamps on the mains begin: at `rig_time_ns` and whole thirds of
// `period_s` before and after, because lamps hang on three phases of the mains.
struct LampMoment {
  int64_t rig_time_ns = 0;  // by the calibration's clocks
  double period_s = 0;      // twice the frequency of the mains
  double sigma_s = 0;       // one sigma of the reading
};

// Of one camera, session and clock epoch.
struct LampPhases {
  std::string session_id, camera;
  int clock = 0;              // equal numbers: one clock
  double offset_sigma_s = 0;  // one sigma of the clock's offset
  std::vector<LampMoment> moments = {};
};

// What lamps say against the clocks of a calibration: findings `lamp_flicker_contradicts`, without
// a severity. All event cameras of a room see lamps of the mains in one phase. Compared are cameras
// of a session that have clocks of their own, reading by reading where both have one of the same
// frequency (100 or 120 Hz) within 0.75 s:
//   - a difference, in the median of five readings or more, of more than 0.5 ms and 5 sigma, modulo
//     a third of the period;
//   - a drift, from the median of the first third of nine readings or more to that of the last, of
//     more than 0.5 ms and 5 sigma.
// One finding for each camera that contradicts most others, until none is left that contradicts
// one; where two contradict each other alone, that of the later name.
std::vector<Finding> FindLampContradictions(std::vector<LampPhases> cameras);

}  // namespace rigcal::server
