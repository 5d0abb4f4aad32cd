// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/value_rows.h"

#include <algorithm>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

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

namespace {

constexpr size_t kWord = 64;

// Of 64 values; bit i is value i.
inline uint64_t WordAtLeast(const uint8_t* values, uint8_t level) {
  uint64_t word = 0;
#if defined(__SSE2__)  // gcc 12 does not find these instructions
  const __m128i least = _mm_set1_epi8(static_cast<char>(level));
  for (size_t i = 0; i < kWord; i += 16) {
    const __m128i own = _mm_loadu_si128(reinterpret_cast<const __m128i*>(values + i));
    const __m128i reached = _mm_cmpeq_epi8(_mm_max_epu8(own, least), own);
    word |= uint64_t{static_cast<uint16_t>(_mm_movemask_epi8(reached))} << i;
  }
#else
  for (size_t i = 0; i < kWord; ++i) word |= uint64_t{values[i] >= level} << i;
#endif
  return word;
}

}  // namespace

void BitsAtLeast(const uint8_t* values, size_t count, uint8_t level, uint64_t* words) {
  const size_t whole = count / kWord;
  for (size_t i = 0; i < whole; ++i) words[i] = WordAtLeast(values + kWord * i, level);
  const size_t left = count % kWord;
  if (left == 0) return;
  uint8_t last[kWord] = {};
  std::memcpy(last, values + kWord * whole, left);
  words[whole] = WordAtLeast(last, level) & (~uint64_t{0} >> (kWord - left));
}

}  // namespace rigcal::agent
