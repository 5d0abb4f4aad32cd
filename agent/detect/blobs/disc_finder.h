// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "agent/detect/blobs/blob_finder.h"

namespace rigcal::agent {

// Finds discs in a blob that is none: a marker whose image has merged with the stick that carries
// it, with a window's frame or with another marker. A disc is where the distance to the blob's edge
// has a maximum and most of a circle around that lies outside of the blob, which a stick or a slat
// crosses but does not fill. Buffers are kept; one thread at a time.
class DiscFinder {
 public:
  // Of the pixels that `finder` takes in the box of `blob`. The pixels of a disc have at least
  // `min_area_px`; a disc that is all of the blob is found too. `bright` as for BlobFinder::Find.
  // Valid until the next call.
  const std::vector<Blob>& Find(const ImageView& image, const BlobFinder& finder, const Blob& blob,
                                int min_area_px, const BrightWords* bright = nullptr);

 private:
  // Sets distance_ to all bits where the mask is.
  void ReadMask(const ImageView& image, const BlobFinder& finder, const BrightWords* bright);
  // Those of at most `most_px`.
  void FillHoles(int most_px);
  void MeasureDistances();
  int16_t At(int x, int y) const { return distance_[static_cast<size_t>(y * stride_ + x)]; }
  bool IsPeak(int x, int y) const;
  bool IsFree(int x, int y, double radius_px) const;
  bool Cut(const ImageView& image, int x, int y, double radius_px, Blob* disc) const;

  PixelRect box_;
  int stride_ = 0;  // of distance_: whole groups of pixels, with one of nothing before and behind
  std::vector<int16_t> distance_;  // to the next pixel outside, in thirds of a pixel
  std::vector<uint64_t> words_;
  RunLabeller holes_;  // of what is not in the mask
  std::vector<Blob> discs_;
};

}  // namespace rigcal::agent
