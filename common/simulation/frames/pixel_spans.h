// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace rigcal {

// Columns [begin, end) of a row.
struct PixelSpan {
  int begin = 0;
  int end = 0;

  // Of one that is not empty.
  size_t size() const { return static_cast<size_t>(end - begin); }
  friend bool operator==(const PixelSpan&, const PixelSpan&) = default;
};

// Puts them in order and joins those that overlap or touch; empty ones go.
void MergeSpans(std::vector<PixelSpan>* spans);
// Takes the columns of `taken` out of `spans`. Both merged, and so is the result.
void SubtractSpans(const std::vector<PixelSpan>& taken, std::vector<PixelSpan>* spans);

}  // namespace rigcal
