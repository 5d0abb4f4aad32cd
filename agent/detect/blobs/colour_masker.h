// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "agent/detect/blobs/image_view.h"
#include "agent/detect/blobs/integer_colour_range.h"
#include "agent/detect/blobs/mask_kernel.h"
#include "agent/detect/blobs/pixel_mask.h"
#include "common/target/colour_range.h"

namespace rigcal::agent {

// Masks the pixels of an image that lie in a colour range. Thread-safe.
class ColourMasker {
 public:
  // Fails with INVALID_ARGUMENT if the range is not valid. The choice of `kernel` changes the
  // speed, never the result.
  static absl::StatusOr<ColourMasker> Create(const ColourRange& range,
                                             const MaskKernel& kernel = BestMaskKernel());

  // Writes the mask bits of columns [64 * first_word, 64 * (first_word + word_count)) of row y, 0
  // past the last column. Returns all words or-ed together. Reads nothing outside of the row. Sets
  // `bright` (may be null) to 1 for words in which a channel of a pixel is `value_min` or more.
  uint64_t MaskRow(const ImageView& image, int y, int first_word, int word_count, uint64_t* words,
                   uint8_t* bright = nullptr) const;

 private:
  ColourMasker(const IntegerColourRange& range, const MaskKernel& kernel)
      : range_(range), kernel_(&kernel) {}

  IntegerColourRange range_;
  const MaskKernel* kernel_;
};

}  // namespace rigcal::agent
