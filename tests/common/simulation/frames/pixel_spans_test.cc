// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/pixel_spans.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/simulation/world/random_stream.h"

namespace rigcal::pixel_spans_test {
namespace {

using Spans = std::vector<PixelSpan>;

TEST(PixelSpans, MergeJoinsWhatOverlapsOrTouches) {
  Spans spans = {{7, 9}, {1, 3}, {5, 5}, {2, 4}, {4, 6}, {12, 11}};
  MergeSpans(&spans);
  EXPECT_EQ(spans, (Spans{{1, 6}, {7, 9}}));
}

// Against a row of flags.
TEST(PixelSpans, SubtractLeavesWhatIsNotTaken) {
  constexpr int kColumns = 40;
  RandomStream draw{1, 2};
  for (int round = 0; round < 500; ++round) {
    Spans spans, taken;
    for (Spans* some : {&spans, &taken}) {
      for (int i = 0; i < 4; ++i) {
        const int begin = static_cast<int>(draw.Uniform(0, kColumns));
        some->push_back({begin, std::min(kColumns, begin + static_cast<int>(draw.Uniform(0, 9)))});
      }
      MergeSpans(some);
    }
    std::vector<bool> expected(kColumns), seen(kColumns);
    for (const PixelSpan& span : spans) {
      for (int x = span.begin; x < span.end; ++x) expected[static_cast<size_t>(x)] = true;
    }
    for (const PixelSpan& span : taken) {
      for (int x = span.begin; x < span.end; ++x) expected[static_cast<size_t>(x)] = false;
    }
    SubtractSpans(taken, &spans);
    for (const PixelSpan& span : spans) {
      ASSERT_LT(span.begin, span.end);
      for (int x = span.begin; x < span.end; ++x) {
        ASSERT_FALSE(seen[static_cast<size_t>(x)]) << round;
        seen[static_cast<size_t>(x)] = true;
      }
    }
    ASSERT_EQ(seen, expected) << round;
  }
}

}  // namespace
}  // namespace rigcal::pixel_spans_test
