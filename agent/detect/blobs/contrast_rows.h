// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

// Loops of ContrastMasker that the compiler turns into vector instructions.

// Of each of `count` pixels of three channels, one channel less another.
void ChannelDifference(const uint8_t* pixels, int channel, int less, size_t count,
                       int16_t* differences);
void Widened(const uint8_t* pixels, size_t count, int16_t* values);

// Sums of 2 x 2 pixels, of two rows of 2 * `count`.
void BlockSums(const int16_t* upper, const int16_t* lower, size_t count, int16_t* sums);

void AddRow(const int16_t* row, size_t count, int32_t* to);
void SubtractRow(const int16_t* row, size_t count, int32_t* from);

// The sums of each of `count` values and the 16 that follow it; `sums` holds 16 more.
void SumsOf17(const int32_t* values, size_t count, int32_t* sums);

// 1 where a value is above the mean of `rows` * `columns` around it by `more`, else 0.
void MoreThanMean(const int16_t* values, const int32_t* sums, const int32_t* columns, int rows,
                  int more, size_t count, uint8_t* marked);

// 1 where more than half of 3 x 3 marks are 1; of `count` in the row of `middle`.
void MostOfNine(const uint8_t* above, const uint8_t* middle, const uint8_t* below, size_t count,
                uint8_t* sums, uint8_t* most);

}  // namespace rigcal::agent
