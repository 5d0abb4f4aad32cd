// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "agent/detect/frame/wand_detector.h"

namespace rigcal::agent {

struct TunedColour {
  ColourRange colour;
  int frames = 0;  // used
  int wands = 0;   // of them with the wand
  // Medians over the markers' pixels, for people. Of grey frames the first two are 0.
  double hue_deg = 0;     // 0 to 360
  double saturation = 0;  // 0 to 1
  double value = 0;       // grey levels, 0 to 255
};

// Learns the colour of a wand from some frames that show it: looks for the wand with wide ranges
// of every hue, takes the most wand-like find of each frame, and
// puts limits with margins around the colours in the middle of its markers. One thread at a time.
class ColourTuner {
 public:
  // INVALID_ARGUMENT: target or camera not valid, or the target has less than three markers (any
  // two lamps would do).
  static absl::StatusOr<ColourTuner> Create(const Target& target, const CameraDescription& camera);

  // INVALID_ARGUMENT: a frame of another size.
  absl::Status Add(const ImageView& image);

  // FAILED_PRECONDITION, with the likely reason and what to do: the wand was in fewer than a third
  // of the frames or in fewer than three, or its finds have no colour in common.
  absl::StatusOr<TunedColour> Result() const;

 private:
  explicit ColourTuner(std::vector<WandDetector> detectors) : detectors_(std::move(detectors)) {}
  void Count(const ImageView& image, const Observation& observation);
  std::string WhyNone() const;

  std::vector<WandDetector> detectors_;  // one per range that is tried
  size_t last_ = 0;                      // the one that found the last wand
  int frames_ = 0;
  int wands_ = 0;
  // Of the frames without a wand.
  int saturated_ = 0, black_ = 0, ambiguous_ = 0, white_ = 0;
  bool grey_ = false;
  std::array<int64_t, 360> hues_{};
  std::array<int64_t, 101> saturations_{};
  std::array<int64_t, 256> values_{};
};

}  // namespace rigcal::agent
