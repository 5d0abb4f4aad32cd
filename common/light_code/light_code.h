// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace rigcal {

// A wand tells how long it has been on, and which wand it is, by the light of its middle sphere
// (the firmware in deploy/wand sends it). Bit k of its code lasts from k to k + 1 bits of 100 ms
// since it began to blink. During a 1 the middle LED rises a tenth of its period later and falls a
// tenth earlier: the sphere is darker, and the middle of each flash stays where it is.
//
// The bits are a maximum-length sequence of degree 20 (Golomb, "Shift Register Sequences", 1967):
// any 20 of them in a row occur once in 29 hours, and all further ones follow from them, which is
// the error check. Each wand number has a primitive polynomial of its own.
inline constexpr double kLightCodeBitS = 0.1;
inline constexpr int kLightCodeDegree = 20;
inline constexpr uint32_t kLightCodeLength = (uint32_t{1} << kLightCodeDegree) - 1;
// Of a blink period: so much later an LED rises during a 1, and so much earlier it falls.
inline constexpr double kLightCodeEdge = 0.1;

// The code of one wand number, 1 to kMaxWandNumber (clock.h).
class LightCode {
 public:
  // The same object at every call; made at the first (some milliseconds).
  static const LightCode& Of(uint32_t wand);

  // Bit `index`; any index, the code repeats after kLightCodeLength.
  bool Bit(int64_t index) const;
  // Whether the wand sends a 1 so long after it began to blink; false before.
  bool IsDimmed(double since_start_s) const;

  // Each bit is a sum modulo 2 of the kLightCodeDegree bits from some index on. Which ones, for the
  // bit `ahead` behind that index, as a mask: bit i for the one i behind it.
  std::vector<uint32_t> Combinations(int ahead_count) const;
  // The index from which the sequence has these bits (bit i: i behind it). None for no bits at all.
  std::optional<int64_t> IndexOf(uint32_t state) const;

 private:
  explicit LightCode(uint32_t taps);

  uint32_t taps_;  // bit i: s[n + 20] has s[n + i] in it
  std::vector<bool> bits_;
};

}  // namespace rigcal
