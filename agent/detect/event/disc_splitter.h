// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace rigcal::agent {

using PixelList = std::vector<std::pair<int, int>>;  // x, y

// Takes apart connected pixels that two or more discs fill, as neighbouring markers of a wand that
// points at the camera do: the set is eroded until it falls into parts each at least half as thick
// as the thickest, and every pixel is given to the disc in whose terms (distance squared less
// radius squared) it is nearest. What falls into more than 64 parts is left whole. The work goes
// with the area of the pixels' box. Buffers are kept; one thread at a time.
class DiscSplitter {
 public:
  // Parts of at least `min_pixels`; `pixels` itself where it does not fall apart. Until the next
  // call.
  const std::vector<PixelList>& Split(const PixelList& pixels, int min_pixels);

 private:
  void MeasureDepth(const PixelList& pixels);
  // Of most parts, the lowest; one part where it never falls apart.
  struct Level {
    int level = 0, parts = 1;
  };
  Level FindLevel(const PixelList& pixels, int min_depth);
  int Root(int at);
  // Parts deeper than `level`, marked in part_ by 1, 2, ...
  int MarkParts(const PixelList& pixels, int level, int min_depth);
  struct Disc {
    double x = 0, y = 0, radius = 0, count = 0;
  };
  void FitDiscs(const PixelList& pixels, int count);
  size_t Nearest(int x, int y) const;

  int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;
  int deepest_ = 0;
  std::vector<int> depth_;  // of the box: chamfer distance to the outside, 3 a pixel
  std::vector<std::vector<int>> by_depth_;  // pixels by their depth
  std::vector<int> parent_;     // by pixel of the box: of the same part; -1: not yet in one
  std::vector<uint8_t> thick_;  // of a part's root: deep enough somewhere
  std::vector<int> part_;
  std::vector<int> pending_;
  std::vector<Disc> discs_;
  std::vector<PixelList> parts_;
};

}  // namespace rigcal::agent
