// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/target/detection_outcome.h"
#include "common/target/observation.h"

namespace rigcal::agent {

// The result for one frame, or for the events of one output interval.
struct Detection {
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  // As the wand's markers lie; without a wand every marker is invisible. A half-occluded sphere is
  // invisible and counted in `occluded_markers`.
  Observation observation;
  double confidence = 0;  // 0 to 1, of the whole wand
  int blob_count = 0;
  int occluded_markers = 0;
  // Candidates were left out to bound the time; without a wand the outcome is kTooManyBlobs.
  bool cut_short = false;
  // Of the pixels, 0 to 1: those that pass the colour test, and those of them that are white, in
  // which no colour is left. Of images that were searched whole.
  double passed_share = 0, white_share = 0;
  int dismissed_patches = 0;  // of the wand's colour, too large to look for markers in front
  bool tracked = false;       // found in the predicted window, without a full search
  // Of the largest marker's image, and of the middle of the brightest one in its brightest channel;
  // 0: no wand, or of events.
  double marker_radius_px = 0, marker_grey = 0;
  // Of the pixels, 0 to 1: those that do not move and are ignored (BackgroundLearner).
  double background_share = 0;
  // Without a wand: three like spheres are in line, but the middle one is not where the target says
  // (OtherWand). 0: no such three. Likewise, the size of three that are spaced as it says.
  double other_middle_share = 0, other_size_ratio = 0;
  bool looks_interlaced = false;  // odd and even rows show what moves at two places
};

}  // namespace rigcal::agent
