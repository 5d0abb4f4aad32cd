// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"

namespace rigcal::agent {

// Marks what has more of a colour than the mean of what is around it, however bright and whatever
// its own colour: the light of a sphere adds to the room's. Of colour it takes the difference of
// two channels, in which white light is nothing; of an image without colour the brightness. It
// looks at blocks of 2 x 2 pixels. Buffers are kept; one thread at a time.
class ContrastMasker {
 public:
  // Channels of a pixel, 0 blue, 1 green, 2 red: in which the colour is strongest and weakest.
  ContrastMasker(int strongest, int weakest) : strongest_(strongest), weakest_(weakest) {}

  // Pixels of a part of the image, as in the mask of the whole; the others are whatever they are.
  // Valid until the next call.
  const PixelMask& Mask(const ImageView& image, const PixelRect& part);

 private:
  void ReadBlocks(const ImageView& image, const PixelRect& part);
  void MarkRow(int row, int x, int y);

  int strongest_, weakest_;
  PixelMask mask_;
  int width_ = 0, height_ = 0;          // of what follows, in blocks
  std::vector<int16_t> blocks_;         // sums of four pixels, row by row
  std::vector<int16_t> upper_, lower_;  // rows of pixels
  std::vector<int32_t> columns_;        // sums over the rows around one, with a border of zeros
  std::vector<int32_t> sums_;           // over the columns around a block too; longer
  std::vector<int32_t> counts_;         // of columns around a block
  std::vector<uint8_t> marked_;
  std::vector<uint64_t> words_;
};

}  // namespace rigcal::agent
