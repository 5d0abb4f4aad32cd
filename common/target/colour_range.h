// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"

namespace rigcal {

// The pixels that may belong to a marker. Of a pixel with channels r, g, b: its value is the
// largest of them (0 to 255), its chroma the largest minus the smallest, its saturation chroma /
// value, and its hue the usual angle of the colour hexagon (red 0, green 120, blue 240 degrees; 0
// of a pixel without chroma). A pixel is taken when its value is at least `value_min` and either
// its saturation and hue are in range, or it is so bright that the sensor has lost its colour
// (`value` and smallest channel >= `washed_out_min`). Of a grey image only `value_min` counts.
struct ColourRange {
  double hue_min_deg = 0;  // [hue_min, hue_max] walks upwards and may pass 360: 340 to 20 holds 0
  double hue_max_deg = 50;
  double saturation_min = 0.35;  // 0 to 1
  int value_min = 60;            // 1 to 255
  int washed_out_min = 250;      // 1 to 256; 256: never

  friend bool operator==(const ColourRange&, const ColourRange&) = default;
  // Every fault.
  absl::Status Validate() const;
};

}  // namespace rigcal
