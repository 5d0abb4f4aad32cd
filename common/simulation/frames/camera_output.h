// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "common/camera/intrinsics.h"

namespace rigcal {

// What cameras do to a picture after the sensor. `bgr`: width * height * 3 bytes.

// A sensor with a Bayer pattern (red first) and the usual linear interpolation of the missing
// colours.
void ApplyBayer(const ImageSize& image_size, std::span<uint8_t> bgr);

// The loss of JPEG: colour at half the resolution, 8x8 cosine transforms, and the quantisation
// tables of ITU-T T.81 (1992), Annex K, scaled by the quality, 1 to 100, as the library of the
// Independent JPEG Group does. The rest of the format loses nothing and is left out.
void ApplyJpegLoss(const ImageSize& image_size, int quality, std::span<uint8_t> bgr);

}  // namespace rigcal
