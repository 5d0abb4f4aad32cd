// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Tells which channel of a pixel a sensor behind a mosaic of colour filters has measured. The
// others were interpolated from neighbours, which smears edges by up to a tenth of a pixel.
struct ColourMosaic {
  // Place of the red filters in cells of 2 x 2; the blue ones are diagonal, the others green.
  int red_x = 0, red_y = 0;  // 0 or 1

  // Returns the measured channel: 0 blue, 1 green, 2 red.
  int Channel(int x, int y) const {
    const bool red_column = (x & 1) == red_x, red_row = (y & 1) == red_y;
    return red_column == red_row ? (red_column ? 2 : 0) : 1;
  }
};

// Finds the mosaic of an image in a part of it: an interpolated value lies between its neighbours,
// a measured one has noise of its own. Returns nothing if the image has none, was compressed or
// scaled, or if `part` shows too little.
std::optional<ColourMosaic> FindMosaic(const ImageView& image, const PixelRect& part);

// The weights of blue, green and red in the brightness (ITU-R BT.601) that JPEG and video keep at
// full resolution, while they keep colour at half of it.
inline constexpr float kLuma[3] = {0.114f, 0.587f, 0.299f};

// Tells whether colour is more blurred than brightness, as in pictures coded with chroma
// subsampling (4:2:0): its second differences are then smaller in relation to its first ones.
// Returns nothing if `part` shows hardly any change of colour.
std::optional<bool> IsColourBlurred(const ImageView& image, const PixelRect& part);

}  // namespace rigcal::agent
