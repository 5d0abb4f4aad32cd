// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/frame_source_spec.h"

#include <utility>

#include "common/status/status_macros.h"

namespace rigcal::agent {

void FrameSourceSpec::AddDetector(OptionTable* table) {
  WandDetectorOptions& detector = detecting.detector;
  ColourRange& colour = detector.colour;
  constexpr double kMaxAreaPx = 100'000'000;
  table->Add("hue_min", &colour.hue_min_deg, {0, 360, "deg"}, "the range may wrap around 0");
  table->Add("hue_max", &colour.hue_max_deg, {0, 360, "deg"}, "of the wand's colour");
  table->Add("saturation_min", &colour.saturation_min, {0, 1}, "of the wand's colour");
  table->Add("value_min", &colour.value_min, {1, 255},
             "grey level of the wand's brightest channel");
  table->Add("washed_out_min", &colour.washed_out_min, {1, 256},
             "grey level at which the colour is lost; 256: never");
  table->Add("min_area", &detector.min_area_px, {1, kMaxAreaPx, "px"}, "of a blob");
  table->Add("max_area", &detector.max_area_px, {1, kMaxAreaPx, "px"}, "of a blob");
  table->Add("max_blobs", &detector.max_blobs, {2, 4096}, "the largest ones are used");
  table->Add("min_distance", &detector.min_distance_m, {0, 1000, "m"}, "of every marker");
  table->Add("max_distance", &detector.max_distance_m, {0, 1000, "m"}, "of every marker");
  table->Add("max_tilt", &detector.max_tilt_deg, {10, 89, "deg"},
             "of the wand out of the image plane");
  table->Add("min_confidence", &detector.min_confidence, {0, 1}, "less is no wand");
  table->Add("tracking", &detector.tracking, "search where the wand is expected first");
  table->AddPath("mask", &detecting.mask_path, "image: white pixels are ignored");
  table->Add("learn_mask", &detecting.learn_mask_s, {0, 600, "s"},
             "at the start of each capture, bright spots are learnt to be ignored");
  table->Add("background", &detecting.background_s, {0, 600, "s"},
             "what has not moved for so long is ignored until it does; 0: never");
}

absl::StatusOr<std::unique_ptr<ObservationSource>> FrameSourceSpec::Create() const {
  RIGCAL_ASSIGN_OR_RETURN(auto frames, Make());
  return DetectingObservationSource::Create(std::move(frames), detecting);
}

}  // namespace rigcal::agent
