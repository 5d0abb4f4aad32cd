// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace rigcal::agent {

// Loops over rows of pixels that the compiler turns into vector instructions.

// The largest channel of each of `count` pixels of three channels, or the mean of them.
void LargestChannels(const uint8_t* pixels, size_t count, uint8_t* values);
void MeanChannels(const uint8_t* pixels, size_t count, uint8_t* values);

uint8_t LargestOf(const uint8_t* values, size_t count);
size_t CountAtLeast(const uint8_t* values, size_t count, uint8_t level);

// Bits of the values that are at least `level`, 64 to a word, 0 past the last one.
void BitsAtLeast(const uint8_t* values, size_t count, uint8_t level, uint64_t* words);

}  // namespace rigcal::agent
