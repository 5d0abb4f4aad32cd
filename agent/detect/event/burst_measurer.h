// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/event/blink_period.h"
#include "agent/detect/event/disc_splitter.h"

namespace rigcal::agent {

// A marker in one burst of light; its area is that of the pixels that lit up.
struct BlinkBlob : Blob {
  double time_us = 0;    // the sensor's clock, lower 32 bits: when the marker was at the centre
  int frequency = 0;     // which of BlinkFilterOptions::blink_hz that is
  double burst_us = 0;   // when its pixels lit up
  double period_us = 0;  // between its last two bursts
  // From where its pixels answer the light's rise to where they answer its fall.
  Eigen::Vector2d rise_to_fall_px = Eigen::Vector2d::Zero();
  // Where its pixels lie along its motion, if they answer one switch of the light: ahead of it (1,
  // the rise), behind (-1, the fall). A pixel that the edge comes to needs a greater change of
  // light than one that it leaves.
  int ahead = 0;
  // Of the pixels of its area, those that answered the light. Less than nearly all: the camera
  // drops events, or pixels are in reset for longer than the light stays on or off.
  double answered_share = 1;
  // A part of the burst came while the sensor was silent (EventGaps).
  bool beside_gap = false;
  bool is_timed = false;  // centre and time are those that FlashMeasurer has measured
};

// From a group of seeds to the markers there, as they were in the last burst that is over. Buffers
// are kept; one thread at a time.
class BurstMeasurer {
 public:
  // Pixels that blink with another of `blinks` are not the marker's. Blobs have at least
  // `min_pixels`, at most kReachPx from the seeds.
  BurstMeasurer(std::vector<BlinkPeriod> blinks, int min_pixels)
      : blinks_(std::move(blinks)), min_pixels_(min_pixels) {}

  // Appends what is not among `blobs` yet: one, several where markers have grown together, or none.
  void Measure(const BlinkPeriod& blink, const ComponentSums& seeds, const BlinkSurface& surface,
               std::vector<BlinkBlob>* blobs);

 private:
  struct Burst {
    double units = 0;  // before `now`
    double period_us = 0;
  };
  // None: the seeds had no burst of this blink.
  std::optional<Burst> FindBurst(const BlinkPeriod& blink, const ComponentSums& seeds,
                                 const BlinkSurface& surface);
  // The pixels that lit up between these ages and are connected with a seed, into lit_.
  void Grow(const BlinkPeriod& blink, const ComponentSums& seeds, const BlinkSurface& surface,
            uint32_t newest, uint32_t oldest);
  bool IsSeedOfAnother(const BlinkPeriod& blink, uint32_t state, uint32_t now) const;
  static void AddBlob(const BlinkPeriod& blink, PixelList* pixels, const Burst& burst,
                      const BlinkSurface& surface, std::vector<BlinkBlob>* blobs);

  std::vector<BlinkPeriod> blinks_;
  int min_pixels_;
  std::vector<int> ages_;
  std::vector<bool> seen_;  // by pixel
  PixelList lit_;
  DiscSplitter splitter_;
};

}  // namespace rigcal::agent
