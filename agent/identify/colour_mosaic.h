// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Which channel of a pixel the sensor has measured, where a mosaic of filters lies over it. The
// others were interpolated from their neighbours, which smears edges by up to a tenth of a pixel.
struct ColourMosaic {
  // Of the red filters; the blue ones are diagonal to them, the others green.
  int red_x = 0, red_y = 0;  // 0 or 1

  // The measured channel: 0 blue, 1 green, 2 red.
  int Channel(int x, int y) const {
    const bool red_column = (x & 1) == red_x, red_row = (y & 1) == red_y;
    return red_column == red_row ? (red_column ? 2 : 0) : 1;
  }
};

// The mosaic of a part of an image, told by this: an interpolated value lies between its
// neighbours, a measured one has noise of its own. None for an image without one, one that was
// compressed or scaled, and where `part` shows too little.
std::optional<ColourMosaic> FindMosaic(const ImageView& image, const PixelRect& part);

// The weights of blue, green and red in the brightness that JPEG and video keep at full resolution
// (ITU-R BT.601), while they keep colour at half of it.
inline constexpr float kLuma[3] = {0.114f, 0.587f, 0.299f};

// Whether colour is more blurred than brightness, as in pictures that were coded with chroma
// subsampling (4:2:0): the second differences of colour over its first ones are smaller. Nothing
// where `part` shows hardly any change of colour.
std::optional<bool> IsColourBlurred(const ImageView& image, const PixelRect& part);

}  // namespace rigcal::agent
