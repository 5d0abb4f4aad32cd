// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "agent/detect/blobs/image_view.h"
#include "common/target/target.h"

namespace rigcal::agent {

enum class ImageExposure : uint8_t {
  kUsable = 1,
  kBlack,      // hardly any pixel is brighter than a dark sensor's noise
  kSaturated,  // more than half of the pixels are saturated
};

// Looks at every 16th pixel of every 16th row.
ImageExposure LookAtExposure(const ImageView& image);

// Share of the same pixels, 0 to 1, of which every channel has at least `least_grey`.
double WhiteShare(const ImageView& image, int least_grey);

// Share of the same pixels, 0 to 1, that are brighter than a dark room.
double LitShare(const ImageView& image);

// One sigma, in seconds, of the mean time of a blinking marker's light (50 % duty) about the middle
// of the exposure. It covers all phases of the blinking, weighted by their light, because markers
// with little light are not found. 0 if the exposure or the frequency is not known.
double LightTimeSigma(double exposure_s, const Target& target);

// The same for an exposure that is shorter than a blink, else 0. A target without a known frequency
// is assumed to blink with 500 Hz.
double ShortLightTimeSigma(double exposure_s, const Target& target);

}  // namespace rigcal::agent
