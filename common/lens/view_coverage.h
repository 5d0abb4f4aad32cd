// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/lens/board_view.h"

namespace rigcal {

// Of the cells of a grid of 10 x 10 over the image, those in which there is a corner.
double CoveredShare(const std::vector<BoardView>& views, const ImageSize& image_size_px);

// "no corner in the left fifth of the image", for each side that lacks them.
std::vector<std::string> BareSides(const std::vector<BoardView>& views,
                                   const ImageSize& image_size_px);

}  // namespace rigcal
