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
  int frames = 0;  // that were used
  int wands = 0;   // frames with the wand
  // Medians over the markers' pixels, for people. Grey frames leave the first two at 0.
  double hue_deg = 0;     // 0 to 360
  double saturation = 0;  // 0 to 1
  double value = 0;       // grey levels, 0 to 255
};

// Learns the colour of a wand from frames that show it. It looks for the wand with wide ranges
// around every hue, takes the most confident find of each frame, and puts limits with margins
// around the colours in the middle of its markers. One thread at a time.
class ColourTuner {
 public:
  // Fails with INVALID_ARGUMENT if target or camera are not valid, or if the target has less than
  // three markers (any two lamps would do).
  static absl::StatusOr<ColourTuner> Create(const Target& target, const CameraDescription& camera);

  // Fails with INVALID_ARGUMENT if the frame has another size.
  absl::Status Add(const ImageView& image);

  // Fails with FAILED_PRECONDITION, the likely reason and advice if the wand was in fewer than a
  // third of the frames or in fewer than three, or if the finds have no colour in common.
  absl::StatusOr<TunedColour> Result() const;

 private:
  explicit ColourTuner(std::vector<WandDetector> detectors) : detectors_(std::move(detectors)) {}
  void Count(const ImageView& image, const Observation& observation);
  std::string WhyNone() const;

  std::vector<WandDetector> detectors_;  // one for each range that is tried
  size_t last_ = 0;                      // index of the detector that found the last wand
  int frames_ = 0;
  int wands_ = 0;
  // Counts of the frames without a wand.
  int saturated_ = 0, black_ = 0, ambiguous_ = 0, white_ = 0;
  bool grey_ = false;
  std::array<int64_t, 360> hues_{};
  std::array<int64_t, 101> saturations_{};
  std::array<int64_t, 256> values_{};
};

}  // namespace rigcal::agent
