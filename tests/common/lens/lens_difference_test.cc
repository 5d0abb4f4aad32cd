// SPDX-License-Identifier: Apache-2.0
#include "common/lens/lens_difference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/common/lens/known_lens.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::lens_difference_test {
namespace {

using namespace rigcal::testing;  // the known lens

TEST(LensDifference, IsNothingForTheSameLens) {
  const auto same = CompareLenses(KnownFisheye(), KnownFisheye(), kKnownImage);
  ASSERT_THAT(same, IsOk());
  EXPECT_LT(same->most_px, 1e-6);
  EXPECT_EQ(same->unknown_share, 0);
}

TEST(LensDifference, TakesTheRotationOut) {
  // Of a long lens a shifted principal point is nearly a rotation.
  Intrinsics lens = {
      .fx_px = 4000, .fy_px = 4000, .cx_px = 320, .cy_px = 240, .distortion = {0, 0, 0, 0, 0}};
  Intrinsics shifted = lens;
  shifted.cx_px += 5;
  const auto difference = CompareLenses(lens, shifted, kKnownImage);
  ASSERT_THAT(difference, IsOk());
  EXPECT_LT(difference->most_px, 0.1);
  Intrinsics longer = lens;
  longer.fx_px = longer.fy_px = 4040;  // 1 %: 4 px at the corner, 400 px off the middle
  const auto zoomed = CompareLenses(lens, longer, kKnownImage);
  ASSERT_THAT(zoomed, IsOk());
  EXPECT_NEAR(zoomed->most_px, 0.01 * std::hypot(319.5, 239.5), 0.1);
  EXPECT_GT(zoomed->p95_px, zoomed->median_px);
}

TEST(LensDifference, RefusesLensesWithNothingInCommon) {
  Intrinsics fold = KnownPinhole();
  fold.distortion = {-30, 0, 0, 0, 0};  // monotone only around the middle
  EXPECT_THAT(CompareLenses(fold, KnownPinhole(), kKnownImage),
              StatusIs(absl::StatusCode::kFailedPrecondition, ::testing::HasSubstr("quarter")));
}

}  // namespace
}  // namespace rigcal::lens_difference_test
