// SPDX-License-Identifier: Apache-2.0
#include "common/light_code/light_code.h"

#include <gtest/gtest.h>

#include <bit>
#include <vector>

#include "common/time/clock.h"

namespace rigcal {
namespace {

// A register of degree 20 whose sequence repeats before has another polynomial than it should.
TEST(LightCode, EveryWindowOccursOnce) {
  for (uint32_t wand = 1; wand <= kMaxWandNumber; ++wand) {
    const LightCode& code = LightCode::Of(wand);
    std::vector<bool> seen(size_t{1} << kLightCodeDegree, false);
    uint32_t window = 0;
    for (int i = 0; i < kLightCodeDegree; ++i) window |= uint32_t{code.Bit(i)} << i;
    EXPECT_EQ(window, 0x6B275u);
    for (int64_t n = 0; n < kLightCodeLength; ++n) {
      ASSERT_FALSE(seen[window]) << "wand " << wand << ", bit " << n;
      seen[window] = true;
      window = window >> 1 | uint32_t{code.Bit(n + kLightCodeDegree)} << (kLightCodeDegree - 1);
    }
  }
}

TEST(LightCode, BitsFollowFromTwentyOthers) {
  const LightCode& code = LightCode::Of(5);
  const std::vector<uint32_t> combinations = code.Combinations(200);
  for (const int64_t from : {int64_t{0}, int64_t{777'777}, int64_t{kLightCodeLength} - 50}) {
    uint32_t state = 0;
    for (int i = 0; i < kLightCodeDegree; ++i) state |= uint32_t{code.Bit(from + i)} << i;
    EXPECT_EQ(code.IndexOf(state), from);
    for (size_t i = 0; i < combinations.size(); ++i) {
      EXPECT_EQ(std::popcount(combinations[i] & state) % 2 != 0,
                code.Bit(from + static_cast<int64_t>(i)));
    }
  }
  EXPECT_EQ(code.IndexOf(0), std::nullopt);
}

TEST(LightCode, WandsSendDifferentBits) {
  for (uint32_t wand = 2; wand <= kMaxWandNumber; ++wand) {
    int differing = 0;
    for (int64_t n = 20; n < 120; ++n) {
      differing += LightCode::Of(1).Bit(n) != LightCode::Of(wand).Bit(n) ? 1 : 0;
    }
    EXPECT_GT(differing, 20);
  }
}

TEST(LightCode, AWandThatIsNotOnSendsNothing) {
  EXPECT_FALSE(LightCode::Of(1).IsDimmed(-0.05));
  EXPECT_TRUE(LightCode::Of(1).IsDimmed(0.05));   // 0x6B275 is odd,
  EXPECT_FALSE(LightCode::Of(1).IsDimmed(0.15));  // and its second bit is 0
}

}  // namespace
}  // namespace rigcal
