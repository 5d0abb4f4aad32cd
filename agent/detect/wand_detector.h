// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "agent/detect/image_view.h"
#include "common/target/observation.h"

namespace rigcal::agent {

// What one picture gave.
enum class DetectionOutcome : uint8_t {
  kWand = 1,
  kNoBlob,        // no pixel in range formed a blob
  kNoWand,        // blobs, but no triple that can be the wand
  kAmbiguous,     // several triples as good as each other
  kTooManyBlobs,  // more than the finder keeps, and no wand among those kept
  kBlack,         // the picture is black: lens cap, exposure, no light
  kSaturated,     // most of the picture is at its brightest
};

struct Detection {
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  // As the wand's markers lie; without a wand every marker is invisible. A half-covered sphere is
  // invisible and counted in `covered_markers`.
  Observation observation;
  double confidence = 0;  // 0 to 1, of the whole wand
  int blob_count = 0;
  int covered_markers = 0;
  bool tracked = false;  // found in the predicted window, without a full search
};

}  // namespace rigcal::agent
