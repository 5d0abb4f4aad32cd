// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

inline constexpr int kMaskWordBits = 64;

// One bit per pixel of an image, packed row by row: column x is bit x % 64 of word x / 64 of its
// row. Bits past the last column are 0.
class PixelMask {
 public:
  PixelMask() = default;
  // All bits start as 0. Sizes below 0 count as 0.
  PixelMask(int width, int height)
      : width_(std::max(0, width)),
        height_(std::max(0, height)),
        words_per_row_((width_ + kMaskWordBits - 1) / kMaskWordBits),
        words_(static_cast<size_t>(words_per_row_) * static_cast<size_t>(height_)) {}

  int width() const { return width_; }
  int height() const { return height_; }
  int words_per_row() const { return words_per_row_; }
  const uint64_t* Row(int y) const { return words_.data() + Offset(y); }
  uint64_t* MutableRow(int y) { return words_.data() + Offset(y); }

  // Returns false outside of the mask.
  bool Get(int x, int y) const {
    return Has(x, y) && (Row(y)[x / kMaskWordBits] >> (x % kMaskWordBits) & 1) != 0;
  }
  // Does nothing outside of the mask.
  void Set(int x, int y, bool value = true) {
    if (!Has(x, y)) return;
    const uint64_t bit = uint64_t{1} << (x % kMaskWordBits);
    uint64_t& word = MutableRow(y)[x / kMaskWordBits];
    word = value ? word | bit : word & ~bit;
  }
  int64_t CountPixels() const {
    int64_t count = 0;
    for (const uint64_t word : words_) count += std::popcount(word);
    return count;
  }

  friend bool operator==(const PixelMask&, const PixelMask&) = default;

 private:
  bool Has(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  size_t Offset(int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(words_per_row_);
  }

  int width_ = 0;
  int height_ = 0;
  int words_per_row_ = 0;
  std::vector<uint64_t> words_;
};

}  // namespace rigcal::agent
