// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/value_rows.h"

#include <algorithm>
#include <cstring>

#include "agent/detect/blobs/clones.h"

namespace rigcal::agent {

RIGCAL_CLONES void LargestChannels(const uint8_t* __restrict pixels, size_t count,
                                   uint8_t* __restrict values) {
  for (size_t i = 0; i < count; ++i) {
    const uint8_t a = pixels[3 * i], b = pixels[3 * i + 1], c = pixels[3 * i + 2];
    const uint8_t ab = a > b ? a : b;
    values[i] = ab > c ? ab : c;
  }
}

RIGCAL_CLONES void MeanChannels(const uint8_t* __restrict pixels, size_t count,
                                uint8_t* __restrict values) {
  for (size_t i = 0; i < count; ++i) {
    const unsigned sum = unsigned{pixels[3 * i]} + pixels[3 * i + 1] + pixels[3 * i + 2];
    values[i] = static_cast<uint8_t>(sum / 3);
  }
}

RIGCAL_CLONES uint8_t LargestOf(const uint8_t* values, size_t count) {
  uint8_t largest = 0;
  for (size_t i = 0; i < count; ++i) largest = values[i] > largest ? values[i] : largest;
  return largest;
}

RIGCAL_CLONES size_t CountAtLeast(const uint8_t* values, size_t count, uint8_t level) {
  constexpr size_t kPart = 255;  // that a byte can count
  size_t sum = 0;
  for (size_t begin = 0; begin < count; begin += kPart) {
    const size_t end = std::min(count, begin + kPart);
    uint8_t part = 0;
    for (size_t i = begin; i < end; ++i) {
      part = static_cast<uint8_t>(part + (values[i] >= level ? 1 : 0));
    }
    sum += part;
  }
  return sum;
}

RIGCAL_CLONES void BitsAtLeast(const uint8_t* values, size_t count, uint8_t level,
                               uint64_t* words) {
  constexpr uint64_t kGather = 0x0102040810204080;  // eight bytes of 0 or 1 to the highest byte
  constexpr size_t kWord = 64;
  for (size_t begin = 0; begin < count; begin += kWord) {
    uint8_t taken[kWord] = {};
    const size_t size = std::min(kWord, count - begin);
    if (size == kWord) {
      for (size_t i = 0; i < kWord; ++i) taken[i] = values[begin + i] >= level ? 1 : 0;
    } else {
      for (size_t i = 0; i < size; ++i) taken[i] = values[begin + i] >= level ? 1 : 0;
    }
    uint64_t word = 0;
    for (size_t i = 0; i < kWord; i += 8) {
      uint64_t eight = 0;
      for (size_t k = 0; k < 8; ++k) eight |= uint64_t{taken[i + k]} << (8 * k);
      word |= (eight * kGather >> 56) << i;
    }
    words[begin / kWord] = word;
  }
}

}  // namespace rigcal::agent
