// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/colour_masker.h"

#include <algorithm>
#include <cstring>

namespace rigcal::agent {

absl::StatusOr<ColourMasker> ColourMasker::Create(const ColourRange& range,
                                                  const MaskKernel& kernel) {
  if (absl::Status status = range.Validate(); !status.ok()) return status;
  return ColourMasker(ToIntegers(range), kernel);
}

uint64_t ColourMasker::MaskRow(const ImageView& image, int y, int first_word, int word_count,
                               uint64_t* words, uint8_t* bright) const {
  const bool colour = image.format == PixelFormat::kBgr8;
  const auto mask = [&](const uint8_t* from, ptrdiff_t next_row, int count, uint64_t* to,
                        uint8_t* noted) {
    if (colour && noted != nullptr) {
      return kernel_->bgr_noting(range_, from, next_row, count, to, noted);
    }
    if (colour) return kernel_->bgr(range_, from, next_row, count, to);
    const uint64_t all = kernel_->mono(range_, from, next_row, count, to);
    for (int i = 0; noted != nullptr && i < count; ++i) noted[i] |= to[i] != 0 ? 1 : 0;
    return all;
  };
  const int word_bytes = kMaskWordBits * BytesPerPixel(image.format);
  const uint8_t* pixels = image.Row(y) + static_cast<ptrdiff_t>(first_word) * word_bytes;
  const int whole_words = std::min(word_count, image.width / kMaskWordBits - first_word);
  uint64_t all = mask(pixels, image.stride_bytes, whole_words, words, bright);
  if (whole_words == word_count) return all;

  // The last word is incomplete: its pixels are copied and padded with black, which is never taken.
  uint8_t padded[kMaskWordBits * 3] = {};
  const int columns = image.width % kMaskWordBits;
  std::memcpy(padded, pixels + static_cast<ptrdiff_t>(whole_words) * word_bytes,
              static_cast<size_t>(columns * BytesPerPixel(image.format)));
  all |=
      mask(padded, 0, 1, words + whole_words, bright == nullptr ? nullptr : bright + whole_words);
  return all;
}

}  // namespace rigcal::agent
