// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "common/target/detection_outcome.h"
#include "common/target/observation.h"

namespace rigcal::agent {

// The result for one frame, or for the events of one output interval.
struct Detection {
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  // The wand's markers in the target's order; without a wand all of them are invisible. A sphere
  // that is half occluded is invisible and counted in `occluded_markers`.
  Observation observation;
  double confidence = 0;  // 0 to 1, of the whole wand
  int blob_count = 0;
  int occluded_markers = 0;
  // Candidates were left out to bound the time. If no wand was found, one may have been missed.
  bool cut_short = false;
  // Shares of the pixels, 0 to 1: those that pass the colour test, and those that are white, so
  // that their colour is lost. Only of images that were searched whole.
  double passed_share = 0, white_share = 0;
  int dismissed_patches = 0;  // of the wand's colour, too large to be searched for markers
  bool tracked = false;       // found in the predicted window, without a full search
  // Radius of the largest marker's image, and grey level of the brightest marker's middle in its
  // brightest channel; 0 without a wand, and for events.
  double marker_radius_px = 0, marker_grey = 0;
  // How bright the wand's middle marker is, lower while it is dimmed (light_code.h): in frames the
  // logarithm of its brightness over the mean of its neighbours', in events the share of a blink in
  // which it is lit. None: not seen whole, saturated, or not measured.
  std::optional<double> light_level;
  // Share of the pixels, 0 to 1, that do not move and are ignored (BackgroundLearner).
  double background_share = 0;
  // Without a wand (OtherWand): where the middle one of three like spheres is, if not where told;
  // or how many times as large as told three well-spaced ones look. 0: no such three.
  double other_middle_share = 0, other_size_ratio = 0;
  // Without a target: what is there instead, and what to say as --target. Empty: nothing is known.
  std::string other_target;
  bool looks_interlaced = false;  // odd and even rows show moving things at two places
};

}  // namespace rigcal::agent
