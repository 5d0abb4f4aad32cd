// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "server/solve/clocks/ray_paths.h"

namespace rigcal::server {

// The time after which a motion repeats itself in a camera's image, in seconds: each marker is
// back where it was, within a small share of how far it usually is from there, wherever it was.
// Clocks that are off by as much fit as well. None where the motion goes on into new places, or
// where there is none.
std::optional<double> FindMotionPeriod(const TrackPaths& paths);

}  // namespace rigcal::server
