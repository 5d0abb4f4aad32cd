// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/contrast_rows.h"

#include "agent/detect/blobs/clones.h"

namespace rigcal::agent {

RIGCAL_CLONES void ChannelDifference(const uint8_t* __restrict pixels, int channel, int less,
                                     size_t count, int16_t* __restrict differences) {
  const uint8_t* const a = pixels + channel;
  const uint8_t* const b = pixels + less;
  for (size_t i = 0; i < count; ++i) {
    differences[i] = static_cast<int16_t>(a[3 * i] - b[3 * i]);
  }
}

RIGCAL_CLONES void Widened(const uint8_t* __restrict pixels, size_t count,
                           int16_t* __restrict values) {
  for (size_t i = 0; i < count; ++i) values[i] = pixels[i];
}

RIGCAL_CLONES void BlockSums(const int16_t* __restrict upper, const int16_t* __restrict lower,
                             size_t count, int16_t* __restrict sums) {
  for (size_t i = 0; i < count; ++i) {
    sums[i] =
        static_cast<int16_t>(upper[2 * i] + upper[2 * i + 1] + lower[2 * i] + lower[2 * i + 1]);
  }
}

RIGCAL_CLONES void AddRow(const int16_t* __restrict row, size_t count, int32_t* __restrict to) {
  for (size_t i = 0; i < count; ++i) to[i] += row[i];
}

RIGCAL_CLONES void SubtractRow(const int16_t* __restrict row, size_t count,
                               int32_t* __restrict from) {
  for (size_t i = 0; i < count; ++i) from[i] -= row[i];
}

RIGCAL_CLONES void SumsOf17(const int32_t* __restrict values, size_t count,
                            int32_t* __restrict sums) {
  // Of two, four, eight and sixteen, each from the one before; from left to right, in place.
  for (size_t i = 0; i < count + 14; ++i) sums[i] = values[i] + values[i + 1];
  for (size_t i = 0; i < count + 12; ++i) sums[i] += sums[i + 2];
  for (size_t i = 0; i < count + 8; ++i) sums[i] += sums[i + 4];
  for (size_t i = 0; i < count; ++i) sums[i] += sums[i + 8] + values[i + 16];
}

RIGCAL_CLONES void MoreThanMean(const int16_t* __restrict values, const int32_t* __restrict sums,
                                const int32_t* __restrict columns, int rows, int more, size_t count,
                                uint8_t* __restrict marked) {
  for (size_t i = 0; i < count; ++i) {
    marked[i] = (values[i] - more) * (columns[i] * rows) > sums[i] ? 1 : 0;
  }
}

RIGCAL_CLONES void MostOfNine(const uint8_t* __restrict above, const uint8_t* __restrict middle,
                              const uint8_t* __restrict below, size_t count,
                              uint8_t* __restrict sums, uint8_t* __restrict most) {
  sums[0] = sums[count + 1] = 0;
  for (size_t i = 0; i < count; ++i) {
    sums[i + 1] = static_cast<uint8_t>(above[i] + middle[i] + below[i]);
  }
  for (size_t i = 0; i < count; ++i) most[i] = sums[i] + sums[i + 1] + sums[i + 2] >= 5 ? 1 : 0;
}

}  // namespace rigcal::agent
