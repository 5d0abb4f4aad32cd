// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/pixel_mask.h"

#include <algorithm>
#include <bit>

namespace rigcal::agent {

PixelMask::PixelMask(int width, int height)
    : width_(std::max(0, width)),
      height_(std::max(0, height)),
      words_per_row_((width_ + kMaskWordBits - 1) / kMaskWordBits),
      words_(static_cast<size_t>(words_per_row_) * static_cast<size_t>(height_)) {}

bool PixelMask::Get(int x, int y) const {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return false;
  return (Row(y)[x / kMaskWordBits] >> (x % kMaskWordBits) & 1) != 0;
}

void PixelMask::Set(int x, int y, bool value) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
  const uint64_t bit = uint64_t{1} << (x % kMaskWordBits);
  uint64_t& word = MutableRow(y)[x / kMaskWordBits];
  word = value ? word | bit : word & ~bit;
}

int64_t PixelMask::CountPixels() const {
  int64_t count = 0;
  for (const uint64_t word : words_) count += std::popcount(word);
  return count;
}

}  // namespace rigcal::agent
