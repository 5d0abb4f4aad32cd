// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/import/imported_rig.h"

namespace rigcal {

// How many of the cameras see the point that comes nearest to all optical axes: it is before them,
// and its projection is in the image. Cameras of a rig look at one volume; read with axes or a
// direction that the file does not mean, they look apart. Cameras without pose do not count.
int CountLookingTogether(std::span<const ImportedCamera> cameras);

// One way to read the poses of a file.
struct PoseReading {
  std::string meaning;  // "the rotation is that of the camera in the rig"
  std::vector<ImportedCamera> cameras;
};

// The reading with which clearly more cameras look together, else the first, which is the
// documented one. `note` says so where it is another; it is left alone otherwise.
std::vector<ImportedCamera> ChooseReading(std::vector<PoseReading> readings, std::string* note);

// Other conventions that a file of a known format may have been written with: the inverse
// transform, and axes of OpenGL (looks along -z, y up), with both. The first one is the file as it
// stands.
std::vector<PoseReading> CommonReadings(const std::vector<ImportedCamera>& cameras);

// Chooses among CommonReadings and adds the note to the rig. Leaves a rig alone of which not every
// camera has a pose.
void RecogniseConvention(ImportedRig* rig);

}  // namespace rigcal
