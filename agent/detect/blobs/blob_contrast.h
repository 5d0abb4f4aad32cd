// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Of a marker against what is around it, over all channels.
inline constexpr double kMinContrastGrey = 50;

struct BlobContrast {
  Eigen::Vector3f core, around;  // means of its middle and of what is right beside it, by channel
  float alike = 0;               // the share of the sides on which it does not differ
};

// Of a blob that differs clearly from its surroundings on most sides, as a lamp does and the
// brighter parts of a warm wall do not; else none. Reads some twenty places of 2 x 2 pixels, a
// cheap test for hundreds of blobs.
std::optional<BlobContrast> StandsOut(const ImageView& image, const Blob& blob,
                                      double min_contrast_grey = kMinContrastGrey);

}  // namespace rigcal::agent
