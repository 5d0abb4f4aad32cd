// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "common/status/refusal.h"
#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"
#include "server/associate/static_points.h"

namespace rigcal::server {

// Runs of a camera's rows that show the same markers at the same pixels, to the last bit, while
// most other cameras of the session see the target move: a driver that hands out one frame again
// and again, or a video that stopped. Twenty rows or more in a run; of each the first row stays,
// and the others are taken away, counted as `duplicate_equal`. Sessions of static points are left
// alone, and so are rows at whose times no other camera sees the target: nothing says that it
// moved.
std::vector<StampFault> TakeFrozenRows(const TargetOfSession& target_of,
                                       std::vector<CameraTrack>* tracks, RefusalCounter* refused);

}  // namespace rigcal::server
