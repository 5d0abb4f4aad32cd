// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/camera/intrinsics.h"

namespace rigcal::accuracy {

// Photographs of this machine to put behind the wand, sorted: those in RIGCAL_PHOTOGRAPHS (a
// folder) or else in the folders where Debian's packages mate-backgrounds and opencv-doc have them.
// At least 512x384. Empty: there are none.
std::vector<std::string> FindPhotographs();

// A part of a photograph, chosen by `seed`, as RoomPainter::PaintPhotograph wants it: linear light,
// with 0.25 in the mean. Empty: it cannot be read.
std::vector<float> LoadPhotograph(const std::string& path, const ImageSize& size, uint32_t seed);

}  // namespace rigcal::accuracy
