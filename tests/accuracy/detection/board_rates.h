// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {

// How many rendered views of each kind of board are found, beside what OpenCV's own functions find
// in the same pictures: tilted by 0 to 70 degrees, blurred, noisy, cut by the border of the image,
// by a pinhole and by a fisheye.
void PrintBoardRates(const SeedOptions& seeds);

}  // namespace rigcal::accuracy
