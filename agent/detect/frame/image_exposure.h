// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "agent/detect/blobs/image_view.h"
#include "common/target/target.h"

namespace rigcal::agent {

enum class ImageExposure : uint8_t {
  kUsable = 1,
  kBlack,      // nothing brighter than a dark sensor's noise
  kSaturated,  // more than half of it at the brightest
};

// Looks at every eighth pixel of every eighth row.
ImageExposure LookAtExposure(const ImageView& image);

// Of the same pixels, 0 to 1: those of which every channel has at least `least_grey`.
double WhiteShare(const ImageView& image, int least_grey);

// Share of the pixels that are brighter than a dark room, 0 to 1.
double LitShare(const ImageView& image);

// One sigma, seconds, of the mean time of the light of a blinking marker (50 % duty) about the
// middle of an exposure, over all phases of its blinking, each as often as it has light: of a short
// exposure with little light nothing is found. 0 where the exposure or the frequency is
// not known.
double LightTimeSigma(double exposure_s, const Target& target);

// The same of an exposure that is shorter than a blink; 0 of any other. A target that does not say
// how fast it blinks is taken to blink with 500 Hz.
double ShortLightTimeSigma(double exposure_s, const Target& target);

}  // namespace rigcal::agent
