// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/associate/camera_track.h"
#include "server/associate/clean_track.h"
#include "server/associate/light_clocks.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Clocks of a session that should share a time base, and count from different beginnings: some
// since 1970, some since their PC was started. Recordings of one session that lie more than a day
// apart by their stamps are such groups. The clocks of the largest group, or of the first of those,
// keep their offset in `known`; the others get one, in whole nanoseconds, with which their
// recordings lie about the same middle. A search by motion does the rest, which seconds as
// floating-point numbers could not hold. Sessions in which a camera has rows in two groups are left
// as they are. `faults`, if not null: the cameras whose clocks got an offset.
void BringFarClocksTogether(const std::vector<CleanTrack>& clean,
                            std::map<ClockKey, ClockOffset>* known,
                            std::vector<StampFault>* faults);

// Which cameras of a session count from which beginning, in words; empty where all count from one.
std::string DescribeFarClocks(const std::vector<CameraTrack>& tracks);

}  // namespace rigcal::server
