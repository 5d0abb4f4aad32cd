// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/events/event_noise.h"
#include "common/simulation/events/event_readout.h"
#include "common/simulation/events/event_render_options.h"
#include "common/simulation/events/low_pass.h"
#include "common/simulation/events/normal_quantiles.h"
#include "common/simulation/world/random_stream.h"

namespace rigcal {

// Photoreceptors and comparators of a sensor (see EventRenderOptions). One thread at a time.
class EventPixels {
 public:
  // `led_light`: ln(light) at which the low pass has its full speed.
  EventPixels(const ImageSize& size, const EventRenderOptions& options, float led_light);

  // As if the pixel had seen this light for long.
  void Settle(uint32_t x, uint32_t y, float light);
  // Neighbours in a row from column x on, to be followed by FollowAdded, each pixel once: ln(light)
  // at the stretch's beginning and end. With no `from`: from what each saw last.
  void Add(uint32_t x, uint32_t y, std::span<const float> from, std::span<const float> to);
  // Follows what was added; its light goes linearly. Appends what the pixels ask.
  void FollowAdded(double begin_us, double duration_us, std::vector<PixelRequest>* requests);
  // Comparators that fire by themselves, unless held in reset. Shot noise falls linearly with the
  // light, from all of it in the dark to a quarter at the LED's light and above: the model of v2e
  // (Hu, Liu, Delbruck, "v2e: From Video Frames to Realistic DVS Events", CVPRW 2021).
  void Fire(std::span<const NoiseEvent> noise, std::vector<PixelRequest>* requests);

 private:
  // Half a cache line.
  struct alignas(32) Pixel {
    double ready_us = 0;  // held in reset until then
    float light = 0;      // what it saw last
    float level = 0;      // behind the low pass
    float reference = 0;
    float on_threshold = 0, off_threshold = 0;  // of the next event
    float refractory_us = 0;
  };
  struct Scales {
    float on = 0, off = 0;
  };
  void DrawThresholds(size_t index);
  void FollowBlock(size_t first, size_t count, double begin_us, double duration_us,
                   std::vector<PixelRequest>* requests);
  void Cross(uint32_t index, const LowPassAnswer& answer, double begin_us, float duration_us,
             std::vector<PixelRequest>* requests);

  float jitter_;
  LowPassSpeed speed_;
  uint32_t width_;
  NormalQuantiles normal_;
  RandomStream random_;
  std::vector<Pixel> pixels_;
  std::vector<Scales> scales_;
  // The added events.
  std::vector<uint32_t> index_;
  std::vector<float> from_, to_;
};

}  // namespace rigcal
