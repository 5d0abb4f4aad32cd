// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "server/associate/camera_track.h"
#include "server/associate/stamp_fault.h"

namespace rigcal::server {

// Markers that are exactly at (0, 0) again and again were not seen: their program writes zeros for
// that. Makes them invisible in every camera of a session that has twenty or more of them.
std::vector<StampFault> HideMarkersAtOrigin(std::vector<CameraTrack>* tracks);

}  // namespace rigcal::server
