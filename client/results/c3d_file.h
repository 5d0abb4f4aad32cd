// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "client/results/point_frames.h"

namespace rigcal::client {

// Points as a C3D file: Intel byte order, floating-point, millimetres, no analog data. A point's
// residual is one sigma (3-D) of the noise of its centres, and its mask has the first seven cameras
// of the calibration. Labels from the 256th on are in POINT:LABELS2 and so on; more than 65 535
// frames are counted by TRIAL:ACTUAL_END_FIELD and POINT:LONG_FRAMES. The group RIGCAL has the
// calibration, and the rig time of the first frame in nanoseconds. Axes are those of the rig frame.
// Source: The C3D File Format User Guide, c3d.org: "The Header Section", "Parameter Format", "3D
// Data - Floating-point Format", "LONG_FRAMES", "The TRIAL Group".
//
// INVALID_ARGUMENT: more than 65 535 markers, or labels too long for the format.
absl::StatusOr<std::string> C3dFile(const PointFrames& frames, const std::string& calibration);

}  // namespace rigcal::client
