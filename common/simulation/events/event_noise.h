// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {

struct NoiseEvent {
  double time_us = 0;
  uint32_t pixel = 0;  // row by row
  bool on = false;
  // Above 0: shot noise, which fires only where the light leaves a larger share of it
  // (EventPixels::Fire).
  float shot_share = 0;
};

// When comparators fire without a change of light: background activity of every pixel alike, shot
// noise, leakage, hot pixels. Together one Poisson process of the whole sensor, so that its events
// come in order of time, each with a pixel by its share of the rate.
class EventNoise {
 public:
  EventNoise(const ImageSize& size, const EventRenderOptions& options);

  // Appends the events before `end_us` that were not yet emitted.
  void Until(double end_us, std::vector<NoiseEvent>* events);

 private:
  double Gap();

  RandomStream draw_;
  uint32_t pixels_;
  double background_, shot_, leak_, hot_total_, total_;  // events per second of the sensor
  double mean_gap_us_;
  double next_us_ = 0;
  std::vector<uint32_t> hot_;
};

}  // namespace rigcal
