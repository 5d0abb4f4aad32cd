// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Least contrast of a marker against its surroundings: grey levels, norm over all channels.
inline constexpr double kMinContrastGrey = 50;

struct BlobContrast {
  Eigen::Vector3f core, around;  // mean grey levels by channel: middle, and right outside
  float alike = 0;  // share of the 16 directions, 0 to 1, in which the blob does not stand out
};

// Returns the contrast of a blob that differs by `min_contrast_grey` from its surroundings in most
// directions, as a lamp does and the brighter parts of a warm wall do not; else nothing. It reads
// some twenty places of 2 x 2 pixels, which is cheap enough for hundreds of blobs.
std::optional<BlobContrast> StandsOut(const ImageView& image, const Blob& blob,
                                      double min_contrast_grey = kMinContrastGrey);

}  // namespace rigcal::agent
