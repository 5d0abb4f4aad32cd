// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "agent/detect/blobs/integer_colour_range.h"

namespace rigcal::agent {

// Turns the pixels of a row into mask bits. It is compiled for several instruction sets, all with
// the same result. A word holds 64 pixels, the first one in its lowest bit; exactly 64 * word_count
// pixels are read. The pixels `next_row` bytes further on are prefetched if they exist. (Without it
// a dark image took AVX-512 1.7 times as long.)
struct MaskKernel {
  const char* name;

  // Each returns all words or-ed together.
  uint64_t (*bgr)(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                  int word_count, uint64_t* words);
  uint64_t (*mono)(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                   int word_count, uint64_t* words);
  // Like `bgr`; also sets `bright` of words with a channel above range.value_below to 1.
  uint64_t (*bgr_noting)(const IntegerColourRange& range, const uint8_t* pixels, ptrdiff_t next_row,
                         int word_count, uint64_t* words, uint8_t* bright);
};

// The fastest kernel that this CPU can run; and all that it can run, the portable one first.
const MaskKernel& BestMaskKernel();
std::vector<const MaskKernel*> AvailableMaskKernels();

}  // namespace rigcal::agent
