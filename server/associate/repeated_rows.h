// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Of rows of one camera in one session that have the same stamp and the same values, as those of a
// file that was appended to itself, one stays: that of the first clock epoch. The others are taken
// away and counted as `duplicate_equal`; twenty or more with markers are a fault. Rows without a
// marker count as repeated only where rows with markers are.
std::vector<StampFault> UseRepeatedRowsOnce(std::vector<CameraTrack>* tracks,
                                            RefusalCounter* refused);

}  // namespace rigcal::server
