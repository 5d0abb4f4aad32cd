// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

inline constexpr int kMaskWordBits = 64;

// One bit per pixel of an image, packed row by row: bit x % 64 of word x / 64 of a row is column
// x. Bits past the last column are 0.
class PixelMask {
 public:
  PixelMask() = default;
  // All 0. Sizes below 0 count as 0.
  PixelMask(int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  int words_per_row() const { return words_per_row_; }
  const uint64_t* Row(int y) const { return words_.data() + Offset(y); }
  uint64_t* MutableRow(int y) { return words_.data() + Offset(y); }

  // False outside of the mask.
  bool Get(int x, int y) const;
  // Nothing happens outside of the mask.
  void Set(int x, int y, bool value = true);
  int64_t CountPixels() const;

  friend bool operator==(const PixelMask&, const PixelMask&) = default;

 private:
  size_t Offset(int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(words_per_row_);
  }

  int width_ = 0;
  int height_ = 0;
  int words_per_row_ = 0;
  std::vector<uint64_t> words_;
};

}  // namespace rigcal::agent
