// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/colour_masker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/agent/detect/blobs/reference_mask.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::colour_masker_test {
namespace {

using ::rigcal::testing::StatusIs;
using ::testing::HasSubstr;

PixelMask Expected(const Image& image, const ColourRange& range) {
  PixelMask mask(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) mask.Set(x, y, image.InRange(range, x, y));
  }
  return mask;
}

PixelMask Mask(const ColourMasker& masker, const ImageView& image) {
  PixelMask mask(image.width, image.height);
  for (int y = 0; y < mask.height(); ++y) {
    masker.MaskRow(image, y, 0, mask.words_per_row(), mask.MutableRow(y));
  }
  return mask;
}

TEST(ColourMasker, RefusesARangeThatIsNotValid) {
  ColourRange range;
  range.value_min = 0;
  EXPECT_THAT(ColourMasker::Create(range).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("value_min")));
}

// Buffers end with the last pixel, so that a sanitizer sees whoever reads on.
TEST(ColourMasker, MasksPicturesOfEveryWidthStrideAndFormat) {
  const ColourRange range = Hues(340, 50);
  for (const MaskKernel* kernel : AvailableMaskKernels()) {
    ASSERT_OK_AND_ASSIGN(const ColourMasker masker, ColourMasker::Create(range, *kernel));
    for (const PixelFormat format : {PixelFormat::kBgr8, PixelFormat::kMono8}) {
      for (int width = 1; width < 200; ++width) {
        Image image(width, 3, format, width % 5);
        FillRandomly(static_cast<uint32_t>(width), 0.5, &image);
        ASSERT_EQ(Mask(masker, image.View()), Expected(image, range))
            << kernel->name << ", width " << width;
      }
    }
  }
}

TEST(ColourMasker, MasksAnyWordsOfARow) {
  Image image(300, 2);
  FillRandomly(3, 0.5, &image);
  const ColourRange range;
  const PixelMask expected = Expected(image, range);
  ASSERT_OK_AND_ASSIGN(const ColourMasker masker, ColourMasker::Create(range));
  for (int first = 0; first < 5; ++first) {
    for (int count = 1; first + count <= 5; ++count) {
      std::vector<uint64_t> words(static_cast<size_t>(count));
      uint64_t all = 0;
      for (int i = 0; i < count; ++i) all |= expected.Row(1)[first + i];
      EXPECT_EQ(masker.MaskRow(image.View(), 1, first, count, words.data()), all);
      for (int i = 0; i < count; ++i) {
        EXPECT_EQ(words[static_cast<size_t>(i)], expected.Row(1)[first + i]) << first << " " << i;
      }
    }
  }
}

TEST(ColourMasker, WalksRowsBackwardsWithANegativeStride) {
  Image image(70, 9);
  FillRandomly(4, 0.5, &image);
  ImageView flipped = image.View();
  flipped.data = flipped.Row(image.height - 1);
  flipped.stride_bytes = -flipped.stride_bytes;
  ASSERT_OK_AND_ASSIGN(const ColourMasker masker, ColourMasker::Create(ColourRange{}));
  const PixelMask mask = Mask(masker, image.View());
  const PixelMask flipped_mask = Mask(masker, flipped);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      ASSERT_EQ(flipped_mask.Get(x, y), mask.Get(x, image.height - 1 - y));
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::colour_masker_test
