// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/results/point_frames.h"

namespace rigcal::client {

// Points as a TRC file (Track Row Column), as OpenSim reads it: millimetres, three columns for each
// marker, tabs; nothing between the tabs where there is no point. Times begin at 0 with the first
// frame. Axes are those of the rig frame. Source: OpenSim's documentation, "Marker (.trc) Files".
// `name`: of the file, which the format repeats in its first line.
std::string TrcFile(const PointFrames& frames, const std::string& name);

}  // namespace rigcal::client
