// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Of a marker against what is around it, over all channels.
inline constexpr double kMinContrastGrey = 50;

// The blob differs clearly from its surroundings on most sides, as a lamp does and the brighter
// parts of a warm wall do not. Reads some twenty pixels, a cheap test for hundreds of blobs.
// `core`: the mean of its middle, by channel, if true; may be null. `alike`: the share of the sides
// on which it does not differ; may be null.
bool StandsOut(const ImageView& image, const Blob& blob, Eigen::Vector3f* core = nullptr,
               float* alike = nullptr, double min_contrast_grey = kMinContrastGrey);

}  // namespace rigcal::agent
