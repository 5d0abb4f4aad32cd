// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

namespace rigcal {

// Logarithm and exponential of single precision for simulated pixels: no branches, so that loops
// over rows become vector code, and the same bits with every mathematical library.

// ln(x) of a normal number > 0, right to 2e-7 of max(1, |ln x|).
inline float FastLog(float x) {
  constexpr int32_t kRootHalf = 0x3f3504f3;
  const auto bits = std::bit_cast<int32_t>(x);
  const int32_t exponent = (bits - kRootHalf) >> 23;
  const auto mantissa = std::bit_cast<float>(bits - exponent * (1 << 23));
  const float s = (mantissa - 1) / (mantissa + 1);
  const float z = s * s;
  const float series = 2 * s * (1 + z * (1.0f / 3 + z * (1.0f / 5 + z * (1.0f / 7))));
  return static_cast<float>(exponent) * 0.693147181f + series;
}

// exp(x) with a relative error below 5e-6, for x from -87 to 87.
inline float FastExpWithin87(float x) {
  constexpr float kRound = 12582912;  // adding it leaves no digits behind the point
  const float whole = (x * 1.44269504f + kRound) - kRound;
  const float rest = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
  const float series =
      1 + rest * (1 + rest * (0.5f + rest * (1.0f / 6 + rest * (1.0f / 24 + rest * (1.0f / 120)))));
  const int32_t scale = (static_cast<int32_t>(whole) + 127) * (1 << 23);
  return series * std::bit_cast<float>(scale);
}

// exp(-x) of x >= 0, as good; nearly 0 beyond 87.
inline float FastDecay(float x) {
  // std::min, by reference, keeps loops from becoming vector code.
  return FastExpWithin87(-(x < 87 ? x : 87));
}

}  // namespace rigcal
