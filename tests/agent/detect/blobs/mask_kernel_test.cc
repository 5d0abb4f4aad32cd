// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/mask_kernel.h"

#include <gtest/gtest.h>

#include "tests/agent/detect/blobs/reference_mask.h"

namespace rigcal::agent::mask_kernel_test {
namespace {

constexpr int kWords = 16;

std::vector<uint64_t> WordByWord(const IntegerColourRange& range,
                                 const std::vector<uint8_t>& pixels, bool colour) {
  std::vector<uint64_t> words(kWords);
  for (size_t i = 0; i < 64 * kWords; ++i) {
    const bool taken = colour ? Takes(range, pixels.data() + 3 * i) : pixels[i] > range.value_below;
    words[i / 64] |= uint64_t{taken} << (i % 64);
  }
  return words;
}

// Every kernel agrees with the reference, and reads and writes no more than it should.
void ExpectSame(const IntegerColourRange& range, const std::vector<uint8_t>& pixels, bool colour) {
  const std::vector<uint64_t> expected = WordByWord(range, pixels, colour);
  uint64_t expected_all = 0;
  for (const uint64_t word : expected) expected_all |= word;
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    std::vector<uint64_t> words(kWords, 0x123456789abcdef0);
    const auto mask = colour ? kernel->bgr : kernel->mono;
    ASSERT_EQ(mask(range, pixels.data(), 500, kWords, words.data()), expected_all) << kernel->name;
    ASSERT_EQ(words, expected) << kernel->name;
    if (!colour) continue;
    std::vector<uint8_t> bright(kWords), expected_bright(kWords);
    for (size_t i = 0; i < pixels.size(); ++i) {
      if (pixels[i] > range.value_below) expected_bright[i / (3 * 64)] = 1;
    }
    ASSERT_EQ(kernel->bgr_noting(range, pixels.data(), 500, kWords, words.data(), bright.data()),
              expected_all)
        << kernel->name;
    ASSERT_EQ(words, expected) << kernel->name;
    ASSERT_EQ(bright, expected_bright) << kernel->name;
  }
}

TEST(MaskKernel, ThePortableOneIsAlwaysThere) {
  EXPECT_STREQ(AvailableMaskKernels().front()->name, "portable");
  EXPECT_STREQ(AvailableMaskKernels().back()->name, BestMaskKernel().name);
}

TEST(MaskKernel, EveryKernelTakesThePixelsOfTheRange) {
  std::mt19937 random(1);
  for (const ColourRange& range : ManyRanges()) {
    const IntegerColourRange integers = ToIntegers(range);
    for (const int span : {2, 20, 255}) {  // greyish to colourful
      std::vector<uint8_t> pixels(64 * 3 * kWords);
      for (size_t i = 0; i < pixels.size(); i += 3) {
        const int low = std::uniform_int_distribution<int>(0, 255 - span)(random);
        std::uniform_int_distribution<int> level(low, low + span);
        for (size_t c = 0; c < 3; ++c) pixels[i + c] = static_cast<uint8_t>(level(random));
      }
      ExpectSame(integers, pixels, true);
      pixels.resize(64 * kWords);
      ExpectSame(integers, pixels, false);
    }
  }
}

// Each pixel of a word alone, among dark ones: none is overlooked by a test of whole groups.
TEST(MaskKernel, FindsASinglePixelAnywhere) {
  const IntegerColourRange range = ToIntegers(ColourRange{});
  for (size_t i = 0; i < 64 * kWords; ++i) {
    std::vector<uint8_t> pixels(64 * 3 * kWords, 40);
    pixels[3 * i + 1] = 50;
    pixels[3 * i + 2] = 200;
    ExpectSame(range, pixels, true);
  }
}

TEST(MaskKernel, NoWordsGiveNothing) {
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    EXPECT_EQ(kernel->bgr(IntegerColourRange{}, nullptr, 0, 0, nullptr), 0u);
    EXPECT_EQ(kernel->mono(IntegerColourRange{}, nullptr, 0, 0, nullptr), 0u);
  }
}

}  // namespace
}  // namespace rigcal::agent::mask_kernel_test
