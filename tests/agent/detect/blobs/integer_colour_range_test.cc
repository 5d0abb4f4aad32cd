// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/integer_colour_range.h"

#include <gtest/gtest.h>

#include "tests/agent/detect/blobs/reference_mask.h"

namespace rigcal::agent::integer_colour_range_test {
namespace {

::testing::AssertionResult AgreesAt(const ColourRange& range, const IntegerColourRange& integers,
                                    int b, int g, int r) {
  const uint8_t bgr[3] = {static_cast<uint8_t>(b), static_cast<uint8_t>(g),
                          static_cast<uint8_t>(r)};
  if (Takes(integers, bgr) == InRange(range, b, g, r)) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure()
         << "b g r " << b << " " << g << " " << r << ", hue " << HueDeg(b, g, r) << ", range "
         << range.hue_min_deg << " to " << range.hue_max_deg << ", saturation "
         << range.saturation_min << ", value " << range.value_min << ", washed out "
         << range.washed_out_min;
}

TEST(IntegerColourRange, TakesEveryColourThatTheRangeHolds) {
  const ColourRange range;
  const IntegerColourRange integers = ToIntegers(range);
  for (int b = 0; b < 256; ++b) {
    for (int g = 0; g < 256; ++g) {
      for (int r = 0; r < 256; ++r) {
        if (!AgreesAt(range, integers, b, g, r)) FAIL() << AgreesAt(range, integers, b, g, r);
      }
    }
  }
}

// Every hue and, by the values that go with it, every kind of saturation, in many ranges.
TEST(IntegerColourRange, TakesEveryHueThatTheRangeHolds) {
  constexpr int kOrders[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  for (const ColourRange& range : ManyRanges()) {
    const IntegerColourRange integers = ToIntegers(range);
    for (int chroma = 0; chroma < 256; ++chroma) {
      const int smallest = (chroma * 89) % (256 - chroma);
      for (int middle = 0; middle <= chroma; ++middle) {
        const int levels[3] = {smallest, smallest + middle, smallest + chroma};
        for (const auto& order : kOrders) {
          const int b = levels[order[0]], g = levels[order[1]], r = levels[order[2]];
          if (!AgreesAt(range, integers, b, g, r)) FAIL() << AgreesAt(range, integers, b, g, r);
        }
      }
    }
  }
}

TEST(IntegerColourRange, TakesEverySaturationThatTheRangeHolds) {
  for (const ColourRange& range : ManyRanges()) {
    const IntegerColourRange integers = ToIntegers(range);
    for (int value = 0; value < 256; ++value) {
      for (int smallest = 0; smallest <= value; ++smallest) {
        for (const int middle : {smallest, (smallest + value) / 2, value}) {
          const auto agrees = AgreesAt(range, integers, smallest, middle, value);
          if (!agrees) FAIL() << agrees;
        }
      }
    }
  }
}

TEST(IntegerColourRange, HoldsItsOwnLimits) {
  const IntegerColourRange orange = ToIntegers(Hues(30, 30));
  const uint8_t on[3] = {0, 100, 200}, beside[3] = {0, 101, 200}, opposite[3] = {200, 100, 0};
  EXPECT_TRUE(Takes(orange, on));
  EXPECT_FALSE(Takes(orange, beside));
  EXPECT_FALSE(Takes(orange, opposite));
}

}  // namespace
}  // namespace rigcal::agent::integer_colour_range_test
