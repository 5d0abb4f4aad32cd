// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/lens/lens_adjustment.h"

namespace rigcal {

// A lens without distortion, with its middle in the middle of the image, and the poses that belong
// to it: of many focal lengths that whose poses show the boards best. The pose of a view is the
// decomposed homography (Zhang 2000, section 3.1), refined. Of `model` only counts whether it is a
// fisheye. FAILED_PRECONDITION: with no focal length could most of the boards be placed before the
// camera.
absl::StatusOr<LensEstimate> StartLens(LensModel model, const ImageSize& image_size_px,
                                       const std::vector<BoardView>& views);

}  // namespace rigcal
