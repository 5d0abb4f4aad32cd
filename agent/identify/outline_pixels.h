// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Pixels of a marker, side by side, filled up to whole groups with some of precision 0.
struct OutlinePixels {
  static constexpr size_t kGroup = 16;

  std::vector<float> x, y;       // px
  std::vector<float> coverage;   // by the marker; 1 where its whole light is seen
  std::vector<float> precision;  // 1 / sigma of the coverage; 0: counts nothing
  // How strongly white light shades the coverage of this pixel's channel, over that of the channel
  // in which the marker stands out most; 1 if all channels are measured.
  std::vector<float> white;
  // 1 if the background behind is saturated, else 0. There the edge appears further inside.
  std::vector<float> saturated_behind;
  // Where the stick may be: 1 on the side of the wand's first marker, 2 on that of its last one,
  // else 0. Empty before MarkStick.
  std::vector<uint8_t> stick_side;
  // The coverage comes from saturated channels, so differences of the light inside are not seen.
  bool clipped = false;

  void Clear();
  void Add(float at_x, float at_y, float its_coverage, float its_precision, float its_white = 1,
           bool is_saturated_behind = false);
  void FillUp();  // pads to whole groups
  size_t size() const { return x.size(); }
  // Tells whether some of them have a saturated background.
  bool IsOutshone() const;
};

}  // namespace rigcal::agent
