// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Finds discs in a blob, where a sphere may have merged with the stick, a window frame or another
// sphere. A disc is where the distance to the blob's edge has a maximum and most of a somewhat
// larger circle lies outside of the blob; a stick or a slat crosses this circle but does not fill
// it. Buffers are kept; one thread at a time.
class DiscFinder {
 public:
  // Searches the pixels that `finder` takes in the box of `blob`. A disc has at least `min_area_px`
  // pixels; a blob that is a single disc is found too. `bright` as for BlobFinder::Find. The result
  // is valid until the next call.
  const std::vector<Blob>& Find(const ImageView& image, const BlobFinder& finder, const Blob& blob,
                                int min_area_px, const BrightWords* bright = nullptr);

 private:
  // Sets distance_ to -1 (all bits) at the pixels of the mask, and to 0 elsewhere.
  void ReadMask(const ImageView& image, const BlobFinder& finder, const BrightWords* bright);
  // Adds holes of at most `most_px` pixels to the mask.
  void FillHoles(int most_px);
  void MeasureDistances();
  int16_t At(int x, int y) const { return distance_[static_cast<size_t>(y * stride_ + x)]; }
  bool IsPeak(int x, int y) const;
  bool IsFree(int x, int y, double radius_px) const;
  bool Cut(const ImageView& image, int x, int y, double radius_px, Blob* disc) const;

  PixelRect box_;
  int stride_ = 0;  // row length of distance_: a multiple of 8, and an empty pixel at each end
  std::vector<int16_t> distance_;  // to the nearest pixel outside, in thirds of a pixel
  std::vector<uint64_t> words_;
  RunLabeller holes_;  // components of the pixels that are not in the mask
  std::vector<Blob> discs_;
};

}  // namespace rigcal::agent
