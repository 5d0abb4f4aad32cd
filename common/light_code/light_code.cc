// SPDX-License-Identifier: Apache-2.0
#include "common/light_code/light_code.h"

#include <bit>
#include <cmath>

#include "common/time/clock.h"

namespace rigcal {
namespace {

constexpr uint32_t kFirstBits = 0x6B275;  // s[0] to s[19], the least significant first

constexpr uint32_t TapsOf(std::initializer_list<int> exponents) {
  uint32_t taps = 1;
  for (const int exponent : exponents) taps |= uint32_t{1} << exponent;
  return taps;
}

// x^20 + ... + 1, by wand number from 1 on; each is primitive.
constexpr uint32_t kTaps[kMaxWandNumber] = {
    TapsOf({3}),         TapsOf({12, 8, 1}), TapsOf({13, 7, 2}), TapsOf({15, 9, 2}),
    TapsOf({17, 11, 2}), TapsOf({17, 6, 3}), TapsOf({16, 7, 3}), TapsOf({11, 9, 3})};

bool Parity(uint32_t word) { return std::popcount(word) % 2 != 0; }

}  // namespace

const LightCode& LightCode::Of(uint32_t wand) {
  static const std::vector<LightCode> codes = [] {
    std::vector<LightCode> made;
    for (const uint32_t taps : kTaps) made.push_back(LightCode(taps));
    return made;
  }();
  return codes[wand - 1];
}

LightCode::LightCode(uint32_t taps) : taps_(taps), bits_(kLightCodeLength) {
  uint32_t state = kFirstBits;
  for (uint32_t n = 0; n < kLightCodeLength; ++n) {
    bits_[n] = (state & 1) != 0;
    state = state >> 1 | uint32_t{Parity(state & taps_)} << (kLightCodeDegree - 1);
  }
}

bool LightCode::Bit(int64_t index) const {
  const int64_t within = index % int64_t{kLightCodeLength};
  return bits_[static_cast<size_t>(within < 0 ? within + kLightCodeLength : within)];
}

bool LightCode::IsDimmed(double since_start_s) const {
  return since_start_s >= 0 && Bit(static_cast<int64_t>(since_start_s / kLightCodeBitS));
}

std::vector<uint32_t> LightCode::Combinations(int ahead_count) const {
  std::vector<uint32_t> combinations;
  for (int n = 0; n < ahead_count; ++n) {
    if (n < kLightCodeDegree) {
      combinations.push_back(uint32_t{1} << n);
      continue;
    }
    uint32_t sum = 0;
    for (int tap = 0; tap < kLightCodeDegree; ++tap) {
      if ((taps_ >> tap & 1) != 0) {
        sum ^= combinations[static_cast<size_t>(n - kLightCodeDegree + tap)];
      }
    }
    combinations.push_back(sum);
  }
  return combinations;
}

std::optional<int64_t> LightCode::IndexOf(uint32_t state) const {
  uint32_t at = kFirstBits;
  for (uint32_t n = 0; n < kLightCodeLength; ++n) {
    if (at == state) return n;
    at = at >> 1 | uint32_t{Parity(at & taps_)} << (kLightCodeDegree - 1);
  }
  return std::nullopt;
}

}  // namespace rigcal
