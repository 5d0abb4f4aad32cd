// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// A blob that can be a whole marker.
struct WholeMarker {
  Blob blob;
  Eigen::Vector3f core;  // mean of its middle, by channel
  double doubt = 0;      // that it is a sphere, as a chi-squared
};

// The radius of a disc of the same area, pixels.
double RadiusOf(const Blob& blob);

// Two whole markers.
struct AlikePair {
  double cost, rank;       // the pairs' order: the least first
  size_t first, last;      // of those given
  bool has_stick = false;  // is seen between them
};

// Those that are alike in brightness, colour and size and not further apart than `longest_radii` of
// their radii: first those between which a stick is seen, then the most alike and largest. `work`:
// pixels that may be read, less those that were.
std::vector<AlikePair> AlikePairs(const ImageView& image, absl::Span<const WholeMarker> wholes,
                                  double longest_radii, bool look_for_stick, double* work);

}  // namespace rigcal::agent
