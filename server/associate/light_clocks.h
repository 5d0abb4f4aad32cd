// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

using ClockKey = std::tuple<std::string, std::string, uint32_t>;  // session, clock, epoch

// Rig time minus the time of a clock epoch, coarse.
struct ClockOffset {
  int64_t offset_ns = 0;
  double sigma_s = 0;
  // The wand whose light code relates this epoch to all others of its session that have the same
  // number here; 0: none does.
  uint32_t wand = 0;
};

// Relates clock epochs that have read the light code of the same wand (common/light_code): where
// two of them read the same time of the wand, it was the same moment. Of those of a session the one
// with the most readings keeps its offset. Others that are in `known` keep theirs where it agrees
// to 20 ms; the time search does the rest there. Where more than a tenth of a clock's readings
// contradict the others, two wands have one number or somebody restarted the wand: a fault, and
// its offset stays as known. Faults also of cameras that read different wands, and of a wand whose
// clock runs wrong. Offsets are changed and added in `known`.
void RelateByLight(const std::vector<CameraTrack>& tracks, std::map<ClockKey, ClockOffset>* known,
                   std::vector<StampFault>* faults);

}  // namespace rigcal::server
