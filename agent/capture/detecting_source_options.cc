// SPDX-License-Identifier: Apache-2.0
// How the wand is found in the pictures of any source.
#include <string>

#include "agent/capture/source_kinds.h"

namespace rigcal::agent {

void TakeDetectingOptions(SourceOptions* options, DetectingOptions* detecting) {
  WandDetectorOptions& detector = detecting->detector;
  ColourRange& colour = detector.colour;
  options->Take("hue_min", "an angle of 0 to 360 degrees", 0.0, 360.0, &colour.hue_min_deg);
  options->Take("hue_max", "an angle of 0 to 360 degrees", 0.0, 360.0, &colour.hue_max_deg);
  options->Take("saturation_min", "a share of 0 to 1", 0.0, 1.0, &colour.saturation_min);
  options->Take("value_min", "a grey level of 1 to 255", 1, 255, &colour.value_min);
  options->Take("washed_out_min", "a grey level of 1 to 255, or 256 for never", 1, 256,
                &colour.washed_out_min);
  options->Take("min_area", "a number of pixels above 0", 1, 100'000'000, &detector.min_area_px);
  options->Take("max_area", "a number of pixels above 0", 1, 100'000'000, &detector.max_area_px);
  options->Take("max_blobs", "a number of blobs, 2 to 4096", 2, 4096, &detector.max_blobs);
  options->Take("min_distance", "a number of metres, 0 to 1000", 0.0, 1000.0,
                &detector.min_distance_m);
  options->Take("max_distance", "a number of metres, 0 to 1000", 0.0, 1000.0,
                &detector.max_distance_m);
  options->Take("max_tilt", "an angle of 10 to 89 degrees", 10.0, 89.0, &detector.max_tilt_deg);
  options->Take("min_confidence", "a number of 0 to 1", 0.0, 1.0, &detector.min_confidence);
  options->Take("tracking", &detector.tracking);
  options->Take("mask", &detecting->mask_path);
  options->Take("learn_mask", "a time of 0 to 600 s", 0.0, 600.0, &detecting->learn_mask_s);
}

}  // namespace rigcal::agent
