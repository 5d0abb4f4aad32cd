// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/export/rig_model.h"

namespace rigcal {

// The fields that anipose, Pose2Sim and caliscope share, one per line: size, matrix, distortions,
// rotation and translation of cam_from_rig (rotation vector; metres), fisheye. Pixels are OpenCV's.
std::string TomlCameraFields(const ExportedCamera& camera);

}  // namespace rigcal
