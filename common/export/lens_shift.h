// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "common/export/rig_model.h"

namespace rigcal {

// How far the lens distortion moves a point of the image at most, in pixels, on a grid over the
// image with its corners. Infinite where the lens model has no inverse in the image.
double LensShiftPx(const ExportedCamera& camera);

// FAILED_PRECONDITION for a program whose cameras have no lens distortion, unless it moves no point
// by more than kHeldWithinPx. `program` begins the reason: "Blender".
absl::Status CheckNoDistortion(const ExportedCamera& camera, const char* program);

}  // namespace rigcal
