// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/export/rig_model.h"

namespace rigcal {

// What the files of each camera are called, without an ending, in the order of the cameras: its
// name, with "camera_" before it where a program or a system takes that for something else (an
// option, "-rf"; a device of Windows, "CON", "com1.left"), and a number behind it where another
// camera's differs in capitals only.
std::vector<std::string> CameraFileNames(const ExportedRig& rig);

}  // namespace rigcal
