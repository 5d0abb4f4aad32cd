// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace rigcal::agent {

// Notes which words of an image's mask (64 pixels of a row each) hold bright pixels. One pass over
// the image fills it, and later passes need not read the dark words.
class BrightWords {
 public:
  // Marks all words as dark. A word is bright if one of its pixels has a channel >= `value_min`.
  void Start(int words_per_row, int height, int value_min) {
    words_per_row_ = words_per_row;
    value_min_ = value_min;
    bright_.assign(static_cast<size_t>(words_per_row) * static_cast<size_t>(height), 0);
  }
  // Marks the rows from `y` on as bright, because they were not read.
  void AssumeFrom(int y) {
    std::fill(bright_.begin() + static_cast<ptrdiff_t>(Offset(y)), bright_.end(), uint8_t{1});
  }

  int value_min() const { return value_min_; }

  // One byte per word: 1 if it is bright, 0 if it is dark.
  uint8_t* MutableRow(int y) { return bright_.data() + Offset(y); }
  const uint8_t* Row(int y) const { return bright_.data() + Offset(y); }

  // Returns the first word in [word, end) that is bright, or dark if not `is_bright`; `end`: none.
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
