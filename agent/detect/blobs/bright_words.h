// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Which words of an image's mask (64 pixels of a row) hold anything bright: one pass over the image
// finds out, and others need not read the rest of it.
class BrightWords {
 public:
  // Nothing is bright, which is to mean: has a channel of `value_min` or more.
  void Start(int words_per_row, int height, int value_min) {
    words_per_row_ = words_per_row;
    value_min_ = value_min;
    bright_.assign(static_cast<size_t>(words_per_row) * static_cast<size_t>(height), 0);
  }
  // Rows from `y` on were not looked at: they may be.
  void AssumeFrom(int y) {
    std::fill(bright_.begin() + static_cast<ptrdiff_t>(Offset(y)), bright_.end(), uint8_t{1});
  }

  int value_min() const { return value_min_; }

  // 1: bright, 0: not. By word.
  uint8_t* MutableRow(int y) { return bright_.data() + Offset(y); }
  const uint8_t* Row(int y) const { return bright_.data() + Offset(y); }

  // The first word from `word` on, before `end`, that is bright, or that is not; `end`: none.
  int Next(int y, int word, int end, bool is_bright) const {
    const uint8_t* const row = Row(y);
    return static_cast<int>(
        std::find(row + word, row + end, static_cast<uint8_t>(is_bright ? 1 : 0)) - row);
  }

 private:
  size_t Offset(int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(words_per_row_);
  }

  int words_per_row_ = 0, value_min_ = 0;
  std::vector<uint8_t> bright_;
};

}  // namespace rigcal::agent
