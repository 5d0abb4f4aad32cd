// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/blobs/pixel_mask.h"

#include <gtest/gtest.h>

namespace rigcal::agent::pixel_mask_test {
namespace {

TEST(PixelMask, HoldsEachPixelApart) {
  PixelMask mask(130, 3);
  EXPECT_EQ(mask.words_per_row(), 3);
  mask.Set(0, 0);
  mask.Set(63, 1);
  mask.Set(64, 1);
  mask.Set(129, 2);
  EXPECT_EQ(mask.CountPixels(), 4);
  EXPECT_TRUE(mask.Get(63, 1));
  EXPECT_FALSE(mask.Get(63, 0));
  EXPECT_FALSE(mask.Get(65, 1));
  EXPECT_EQ(mask.Row(2)[2], uint64_t{2});
  mask.Set(64, 1, false);
  EXPECT_FALSE(mask.Get(64, 1));
  EXPECT_EQ(mask.CountPixels(), 3);
}

TEST(PixelMask, HasNothingOutside) {
  PixelMask mask(65, 2);
  for (const auto& [x, y] : {std::pair(-1, 0), {0, -1}, {65, 0}, {127, 1}, {0, 2}}) {
    mask.Set(x, y);
    EXPECT_FALSE(mask.Get(x, y)) << x << " " << y;
  }
  EXPECT_EQ(mask.CountPixels(), 0);
  EXPECT_EQ(PixelMask(-4, 7).words_per_row(), 0);
  EXPECT_FALSE(PixelMask().Get(0, 0));
}

}  // namespace
}  // namespace rigcal::agent::pixel_mask_test
