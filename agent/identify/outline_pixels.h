// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Pixels side by side, filled up to whole groups with some that count nothing.
struct OutlinePixels {
  static constexpr size_t kGroup = 16;

  std::vector<float> x, y;       // px
  std::vector<float> coverage;   // of each pixel by the marker, 1 where its whole light is seen
  std::vector<float> precision;  // 1 / sigma of the coverage; 0: counts nothing
  // How strongly white light shades the coverage of this pixel's channel, against the channel in
  // which the marker stands out most; 1 where all channels are measured.
  std::vector<float> white;
  // 1 where the background behind is saturated, else 0. An edge looks further inside there.
  std::vector<float> saturated_behind;
  // One sigma of the coverage, because the background changes here; not yet in the precision.
  std::vector<float> unsure;
  // The stick may be here: on the side of the wand's first marker 1, of its last one 2, else 0.
  // Empty: not marked (MarkStick).
  std::vector<uint8_t> stick_side;
  // The coverage is that of saturated channels: how the light differs inside is not seen.
  bool clipped = false;

  void Clear();
  void Add(float at_x, float at_y, float its_coverage, float its_precision, float its_white = 1,
           bool is_saturated_behind = false, float how_unsure = 0);
  void FillUp();
  // Moves what is unsure into the precision. False: nothing is.
  bool CountUnsure();
  size_t size() const { return x.size(); }
  // Some of them have a saturated background.
  bool IsOutshone() const;
};

}  // namespace rigcal::agent
