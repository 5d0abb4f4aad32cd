// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <string>

namespace rigcal {

// Appends a number as its bytes, the lowest first.
template <typename Number>
void AppendLittleEndian(Number value, std::string* bytes) {
  static_assert(sizeof(Number) <= 8);
  uint64_t bits = 0;
  if constexpr (sizeof(Number) == 8) {
    bits = std::bit_cast<uint64_t>(value);
  } else {
    bits = static_cast<uint64_t>(value);
  }
  for (size_t i = 0; i < sizeof(Number); ++i) {
    bytes->push_back(static_cast<char>(bits >> (8 * i) & 0xff));
  }
}

}  // namespace rigcal
