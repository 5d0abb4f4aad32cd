// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/metavision/byte_aligner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace rigcal::agent::byte_aligner_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(ByteAligner, WholeWordsAreNotCopied) {
  ByteAligner joiner(4);
  const std::vector<uint8_t> bytes = {1, 2, 3, 4, 5, 6, 7, 8};
  const auto words = joiner.Join(bytes);
  EXPECT_EQ(words.data(), bytes.data());
  EXPECT_EQ(words.size(), 8u);
}

TEST(ByteAligner, JoinsAWordThatWasCut) {
  ByteAligner joiner(4);
  EXPECT_THAT(joiner.Join(std::vector<uint8_t>{1, 2, 3}), IsEmpty());
  EXPECT_THAT(joiner.Join(std::vector<uint8_t>{4, 5}), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(joiner.Join(std::vector<uint8_t>{}), IsEmpty());
  EXPECT_THAT(joiner.Join(std::vector<uint8_t>{6, 7, 8}), ElementsAre(5, 6, 7, 8));
}

TEST(ByteAligner, WhereverItIsCutTheStreamIsTheSame) {
  std::vector<uint8_t> stream(1000);
  std::iota(stream.begin(), stream.end(), 0);
  for (const size_t word_bytes : {2u, 4u, 8u}) {
    for (size_t step = 1; step <= 19; ++step) {
      ByteAligner joiner(word_bytes);
      std::vector<uint8_t> joined;
      for (size_t at = 0; at < stream.size(); at += step) {
        const size_t size = std::min(step, stream.size() - at);
        const auto words = joiner.Join(std::span<const uint8_t>(stream).subspan(at, size));
        ASSERT_EQ(words.size() % word_bytes, 0u);
        joined.insert(joined.end(), words.begin(), words.end());
      }
      ASSERT_EQ(joined, stream) << word_bytes << " " << step;
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::byte_aligner_test
