// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "server/associate/camera_track.h"

namespace rigcal::server {

// Checks that the times of the rows are nanoseconds: that their steps are those of a camera, 0.1 Hz
// to 20 kHz, and that the wand did not cross the image in no time. Stamps in microseconds,
// milliseconds, seconds, or row numbers, look like a camera a thousand times too fast or faster,
// and every clock offset and rate found with them would be wrong.
//
// INVALID_ARGUMENT: names every such camera with the median step, what unit its stamps are likely
// in, and the factor. Tracks with fewer than 20 rows are not judged.
absl::Status CheckStampUnits(const std::vector<CameraTrack>& tracks);

}  // namespace rigcal::server
