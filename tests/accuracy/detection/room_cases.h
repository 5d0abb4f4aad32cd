// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tests/accuracy/detection/detection_options.h"

namespace rigcal::accuracy {

// What makes DetectionOptions those of a kind of room.
struct DetectionCase {
  std::string name;
  std::function<void(DetectionOptions*)> change;
};

// Rooms as they are; the first ones are dark. With `photographs` (paths of image files) also those
// in which they are behind the wand.
std::vector<DetectionCase> RoomCases(const std::vector<std::string>& photographs);

}  // namespace rigcal::accuracy
