// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "agent/detect/blobs/blob_finder.h"
#include "agent/detect/blobs/image_view.h"

namespace rigcal::agent {

// Whether a blob fills an ellipse that is hardly longer than a sphere's image.
bool IsRound(const Blob& blob);

// Takes blobs apart that have grown together: a marker in front of wood whose colour is in range
// too, or two markers of a wand that points at the camera. Buffers are kept; one thread at a time.
class BlobSplitter {
 public:
  // What of `blob` is bright against its brightest parts, as blobs of at least `min_area_px`; at a
  // higher level again what is not round then. `blob` itself where that tells nothing new or its
  // box is too large to be looked at. Until the next call.
  const std::vector<Blob>& Split(const ImageView& image, const Blob& blob, int min_area_px);

 private:
  void AddBright(const ImageView& image, const Blob& blob, int level, int min_area_px,
                 std::vector<Blob>* parts);
  Blob Flood(int start, int level);

  PixelRect box_;
  std::vector<uint8_t> value_;  // of the box: the largest channel, 0 once it has been visited
  std::vector<int> pending_;
  std::vector<Blob> first_, parts_;
};

}  // namespace rigcal::agent
