// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/calibration.pb.h"

namespace rigcal {

// The same calibration for images whose lens distortion has been taken out with the camera matrix
// kept (OpenCV: undistort, and fisheye::undistortImage with Knew = K): every camera is a pinhole.
// For programs whose cameras have no lens distortion.
rigcal::v1::Calibration Undistorted(rigcal::v1::Calibration calibration);

}  // namespace rigcal
