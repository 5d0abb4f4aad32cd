// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/pixel_mask.h"

namespace rigcal::agent {

// Marks what has more of a colour than the mean of what is around it, however bright and whatever
// its own colour: the light of a sphere adds to the room's. Of colour it takes the difference of
// two channels, in which white light is nothing; of an image without colour the brightness. It
// looks at blocks of 2 x 2 pixels. How much more that is follows from the image's noise; a block is
// marked if it and its eight neighbours mostly are. Buffers are kept; one thread at a time.
class ContrastMasker {
 public:
  // Channels of a pixel, 0 blue, 1 green, 2 red: in which the colour is strongest and weakest.
  ContrastMasker(int strongest, int weakest) : strongest_(strongest), weakest_(weakest) {}

  // Pixels of a part of the image, as in the mask of the whole; the others are whatever they are.
  // Valid until the next call.
  const PixelMask& Mask(const ImageView& image, const PixelRect& part);

 private:
  void ReadBlocks(const ImageView& image, const PixelRect& part);
  // One sigma of a block's sum, of a sample of the image.
  double BlockNoise(const ImageView& image);
  void MarkRow(int row, int more, uint8_t* marked);
  void WriteRow(const uint8_t* above, const uint8_t* middle, const uint8_t* below, int x, int y);

  int strongest_, weakest_;
  PixelMask mask_;
  int width_ = 0, height_ = 0;          // of what follows, in blocks
  std::vector<int16_t> blocks_;         // sums of four pixels, row by row
  std::vector<int16_t> upper_, lower_;  // rows of pixels
  std::vector<int32_t> columns_;        // sums over the rows around one, with a border of zeros
  std::vector<int32_t> sums_;           // over the columns around a block too; longer
  std::vector<int32_t> counts_;         // of columns around a block
  std::array<std::vector<uint8_t>, 3> marked_;  // of three rows
  std::vector<uint8_t> most_, sums_of_three_;
  std::vector<int> steps_;  // between neighbouring blocks
  std::vector<uint64_t> words_;
};

}  // namespace rigcal::agent
