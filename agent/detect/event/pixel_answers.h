// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace rigcal::agent {

// Which switches of a blinking light pixels answer. Where the light is on, or off, for a shorter
// time than a pixel's refractory period, the pixel is still blind at the second of the two switches
// and free again at the next first one: it fires once in each period, always with one polarity.
enum class PixelAnswers : uint8_t { kBoth, kRise, kFall };

}  // namespace rigcal::agent
