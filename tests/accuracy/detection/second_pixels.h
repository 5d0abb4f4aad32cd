// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "agent/event/evt3_writer.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/frames/scene_ground_truth.h"

namespace rigcal::accuracy {

// Pixels of an event camera by other formulas than those of common/simulation/events, and without
// its code: a photoreceptor of second order, worked out in steps of 5 us, before discs with a soft
// edge. What holds before both sensors does not rest on what one of them assumes.
struct SecondPixelOptions {
  double blink_hz = 500, duty = 0.5, phase = 0;
  double contrast = 1;      // the LED's light in terms of what the sphere reflects
  double room_share = 0.4;  // light of the room behind in terms of that
  double edge_px = 0.6;     // one sigma of the blur
  double on_threshold = 0.22, off_threshold = 0.22;  // of ln(light)
  double threshold_spread = 0.08;                    // one sigma over the pixels, relative
  double cutoff_hz = 3000;                           // of both low passes, before a lit sphere
  bool follows_light = false;  // in the dark the cut-off is lower, in proportion to the light
  double refractory_us = 100;
  uint32_t seed = 1;
};

using DiscPath = std::function<std::vector<MarkerGroundTruth>(double time_s)>;

// The events of `duration_s` by time; the discs blink in step.
std::vector<agent::CdEvent> RenderSecondPixels(const SecondPixelOptions& options,
                                               const ImageSize& size, const DiscPath& discs,
                                               double duration_s);

}  // namespace rigcal::accuracy
