// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "agent/detect/blobs/run_labeller.h"
#include "agent/detect/event/blink_blob.h"
#include "agent/detect/event/blink_period.h"
#include "agent/detect/event/blink_surface.h"
#include "agent/detect/event/disc_splitter.h"

namespace rigcal::agent {

// From a group of seeds to the markers there, as they were in the last burst that is over. Buffers
// are kept; one thread at a time.
class BurstMeasurer {
 public:
  // Pixels that blink with another of `blinks` are not the marker's. Blobs have at least
  // `min_pixels`, at most `reach_px` from the seeds.
  BurstMeasurer(std::vector<BlinkPeriod> blinks, int min_pixels, int reach_px);

  // Appends what is not among `blobs` yet: one, several where markers have grown together, or none.
  void Measure(const BlinkPeriod& blink, const ComponentSums& seeds, const BlinkSurface& surface,
               std::vector<BlinkBlob>* blobs);

 private:
  struct Burst {
    double start_units = 0;  // before `now`
    double period_us = 0;
    bool found = false;
  };
  Burst FindBurst(const BlinkPeriod& blink, const ComponentSums& seeds,
                  const BlinkSurface& surface);
  // The pixels that lit up between these ages and are connected with a seed, into lit_.
  void Grow(const BlinkPeriod& blink, const ComponentSums& seeds, const BlinkSurface& surface,
            uint32_t newest, uint32_t oldest);
  bool IsSeedOfAnother(const BlinkPeriod& blink, uint32_t state, uint32_t now) const;
  // Drops from lit_ what hangs on by a pixel or two, and fills in pixels that were dead: noise.
  void Smooth();
  static void AddBlob(const BlinkPeriod& blink, PixelList* pixels, const Burst& burst,
                      const BlinkSurface& surface, std::vector<BlinkBlob>* blobs);

  std::vector<BlinkPeriod> blinks_;
  int min_pixels_, reach_px_;
  std::vector<int> ages_;
  PixelRect window_;           // of seen_
  std::vector<uint8_t> seen_;  // by pixel: kSeen, kLit
  PixelList lit_, smoothed_;
  DiscSplitter splitter_;
};

}  // namespace rigcal::agent
