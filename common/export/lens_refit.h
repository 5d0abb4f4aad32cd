// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "common/export/rig_model.h"

namespace rigcal {

// What a format can say of a lens.
enum class LensRange : uint8_t {
  kAll,         // every model of ours
  kRadtan,      // Brown-Conrady without k3, and fisheye
  kNoRational,  // Brown-Conrady and fisheye
  kOneFocal,    // the same with one focal length for both axes
  kPinhole,     // no distortion
};

// Replaces each lens that the format cannot say by the one in its range that is nearest over the
// image (least squares on a grid with the corners), and sets the camera's refit_error_px: the
// largest distance over that grid. FAILED_PRECONDITION: it is larger than `max_error_px`, or the
// lens is not known in the whole image; the camera and the error are named, and --undistorted as
// the other way. `program` is the one whose range it is.
absl::Status RefitLenses(LensRange range, const char* program, double max_error_px,
                         ExportedRig* rig);

}  // namespace rigcal
