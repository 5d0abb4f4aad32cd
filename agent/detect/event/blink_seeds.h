// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/run_labeller.h"
#include "agent/detect/event/blink_period.h"

namespace rigcal::agent {

// Seeds of markers: pixels that blink with its period, joined to groups. Buffers are
// kept; one thread at a time.
class BlinkSeeds {
 public:
  // A tile in which no pixel has blinked for `recent_us` is passed over. Groups of fewer than
  // `min_pixels` do not count when there are too many.
  BlinkSeeds(uint32_t recent_us, int min_pixels) : recent_us_(recent_us), min_pixels_(min_pixels) {}

  // Groups from top to bottom; only the largest when there are many, so that the time is bounded
  // when a screen or a wall of lamps blinks as the wand does. Valid until the next call.
  const std::vector<ComponentSums>& Find(const BlinkPeriod& blink, const BlinkSurface& surface);

 private:
  void Mark(const BlinkPeriod& blink, const BlinkSurface& surface);
  const std::vector<ComponentSums>& Promising(const std::vector<ComponentSums>& components,
                                              SensorGeometry geometry);

  uint32_t recent_us_;
  int min_pixels_;
  std::vector<uint64_t> words_;  // of a row, a bit for each pixel
  RunLabeller labeller_;
  std::vector<size_t> largest_;  // indices of components
  std::vector<ComponentSums> promising_;
};

}  // namespace rigcal::agent
