// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/event_readout.h"
#include "common/simulation/event_render_options.h"
#include "common/simulation/random_stream.h"

namespace rigcal {

// ln(light) of a pixel at both ends of a stretch of time, without and with the LED; between them it
// is taken as linear.
struct PixelLight {
  float dark_begin = 0, dark_end = 0;
  float lit_begin = 0, lit_end = 0;
};

// A part of such a stretch during which the LED does not switch.
struct LightStep {
  double end_us = 0;  // since the stretch began
  bool lit = false;
};

// Photoreceptors and comparators of a sensor (see EventRenderOptions). One thread at a time.
class EventPixels {
 public:
  // `led_light`: ln(light) at which the low pass has its full speed.
  EventPixels(const ImageSize& size, const EventRenderOptions& options, float led_light);

  // As if the pixel had seen this light for long.
  void Settle(uint32_t x, uint32_t y, float light);
  // Follows the light through `steps`, which begin at `begin_us`, and appends what the pixel asks.
  void Follow(uint32_t x, uint32_t y, const PixelLight& light, double begin_us,
              std::span<const LightStep> steps, std::vector<PixelRequest>* requests);
  // The comparator fires by itself, unless the pixel is held in reset.
  void Fire(uint32_t x, uint32_t y, bool on, double time_us, std::vector<PixelRequest>* requests);

 private:
  struct Pixel {
    double ready_us = 0;  // held in reset until then
    float level = 0;      // behind the low pass
    float reference = 0;
    float on_threshold = 0, off_threshold = 0;  // of the next event
    float on_scale = 0, off_scale = 0, refractory_us = 0;
  };
  float Jitter() { return static_cast<float>(1 + options_.threshold_jitter * random_.Gaussian()); }
  float TimeConstant(float light) const;
  void DrawThresholds(Pixel* pixel);

  EventRenderOptions options_;
  uint32_t width_;
  float led_light_;
  RandomStream random_;
  std::vector<Pixel> pixels_;
};

}  // namespace rigcal
