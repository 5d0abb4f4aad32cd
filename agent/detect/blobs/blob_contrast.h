// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// The blob differs clearly from its surroundings on most sides, as a lamp does and the brighter
// parts of a warm wall do not. Reads some twenty pixels, a cheap test for hundreds of blobs.
// `min_contrast_grey`: over all channels.
bool StandsOut(const ImageView& image, const Blob& blob, double min_contrast_grey);

}  // namespace rigcal::agent
