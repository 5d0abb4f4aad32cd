// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/camera/camera_description.h"
#include "common/target/target.h"

namespace rigcal::accuracy {

// A camera like those of the eWand paper: about 1 010 px of focal length, barrel distortion.
CameraDescription PaperCamera(ImageSize image_size_px, double cy_px);

// Its wand: spheres of 40 mm at 0, 0.13 and 0.39 m, 500 Hz.
Target PaperWand();

}  // namespace rigcal::accuracy
