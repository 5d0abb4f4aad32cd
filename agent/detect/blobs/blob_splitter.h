// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// The blob fills an ellipse that is hardly longer than a sphere's image.
bool IsRound(const Blob& blob);

// Splits blobs that have merged: a marker in front of wood whose colour is in range
// too, or two markers of a wand that points at the camera. Buffers are kept; one thread at a time.
class BlobSplitter {
 public:
  // Thresholds `blob` relative to its brightest pixels into blobs of at least `min_area_px`; parts
  // that are not round again at a higher level. By the largest channel, or by the mean of all where
  // that is clipped. `blob` itself where it stays one or its box is too large. Valid until the next
  // call.
  const std::vector<Blob>& Split(const ImageView& image, const Blob& blob, int min_area_px);

 private:
  void ReadValues(const ImageView& image, const PixelRect& box, bool means);
  int BrightValue() const;
  void AddBright(const ImageView& image, const PixelRect& part, int level, int min_area_px,
                 std::vector<Blob>* parts);

  PixelRect box_;
  std::vector<uint8_t> value_;  // of the box
  std::vector<uint64_t> words_;
  RunLabeller labeller_;
  std::vector<Blob> first_, parts_;
};

}  // namespace rigcal::agent
