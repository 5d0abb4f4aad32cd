// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/value_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace rigcal::agent::value_rows_test {
namespace {

std::vector<uint8_t> Random(size_t count) {
  std::mt19937 random(static_cast<uint32_t>(count));
  std::vector<uint8_t> values(count);
  for (uint8_t& value : values) value = static_cast<uint8_t>(random());
  return values;
}

constexpr size_t kCounts[] = {1, 7, 16, 63, 64, 65, 200, 700};

TEST(ValueRows, ReadChannels) {
  for (const size_t count : kCounts) {
    const std::vector<uint8_t> pixels = Random(3 * count);
    std::vector<uint8_t> largest(count), mean(count);
    LargestChannels(pixels.data(), count, largest.data());
    MeanChannels(pixels.data(), count, mean.data());
    for (size_t i = 0; i < count; ++i) {
      const int a = pixels[3 * i], b = pixels[3 * i + 1], c = pixels[3 * i + 2];
      ASSERT_EQ(largest[i], std::max({a, b, c}));
      ASSERT_EQ(mean[i], (a + b + c) / 3);
    }
  }
}

TEST(ValueRows, CountAndMarkWhatIsAtLeast) {
  for (const size_t count : kCounts) {
    const std::vector<uint8_t> values = Random(count);
    EXPECT_EQ(LargestOf(values.data(), count), *std::ranges::max_element(values));
    for (const uint8_t level : std::vector<uint8_t>{0, 1, 128, 255}) {
      std::vector<uint64_t> words((count + 63) / 64, 0x123456789abcdef0), expected(words.size());
      size_t at_least = 0;
      for (size_t i = 0; i < count; ++i) {
        const bool is = values[i] >= level;
        at_least += is ? 1 : 0;
        expected[i / 64] |= uint64_t{is} << (i % 64);
      }
      EXPECT_EQ(CountAtLeast(values.data(), count, level), at_least);
      BitsAtLeast(values.data(), count, level, words.data());
      EXPECT_EQ(words, expected);
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::value_rows_test
