// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/visible_arc.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace rigcal::agent::visible_arc_test {
namespace {

constexpr double kNoise = 0.02, kRadius = 8, kBlurPx = 0.7;
const Eigen::Vector2d kCentre(20.3, 19.6);

double Step(double inside_px) { return 0.5 * std::erfc(-inside_px / (kBlurPx * std::sqrt(2.0))); }

struct View {
  double hidden_from_px = 100;  // to the right of the centre
  double notch_half_px = 0;     // of a stick that ends 3 px inside, from above
  int image_from_y = -100;      // the border
};

OutlinePixels Disc(const View& view) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, kNoise);
  OutlinePixels pixels;
  for (int y = std::max(view.image_from_y, 6); y <= 34; ++y) {
    for (int x = 6; x <= 34; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - kCentre;
      double cover = Step(kRadius - d.norm()) * Step(view.hidden_from_px - d.x());
      if (view.notch_half_px > 0 && d.y() < 3 - kRadius) {
        cover *= 1 - Step(view.notch_half_px - std::abs(d.x()));
      }
      pixels.Add(static_cast<float>(x), static_cast<float>(y),
                 static_cast<float>(cover + noise(random)), static_cast<float>(1 / kNoise));
    }
  }
  pixels.FillUp();
  return pixels;
}

class VisibleArcOf {
 public:
  explicit VisibleArcOf(const View& view) : pixels(Disc(view)) {
    outline.centre_px = kCentre;
    outline.radius_px = kRadius;
    fitted = fitter.Fit(pixels, round, {}, &outline);
    before_px = outline.centre_px;
    expected.radius_px = kRadius;
    expected.radius_sigma_px = 0.3;
    expected.is_cut = view.image_from_y > 0;
    arc = FindVisibleArc(pixels, round, {}, expected, &fitter, &outline);
  }

  OutlinePixels pixels;
  Eigen::Matrix2d round = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
  SphereOutlineFitter fitter;
  SphereOutline outline;
  ArcExpectation expected;
  VisibleArc arc;
  Eigen::Vector2d before_px;
  bool fitted = false;
};

TEST(FindVisibleArc, LeavesAWholeSphereAsItIs) {
  const VisibleArcOf whole({});
  ASSERT_TRUE(whole.fitted);
  EXPECT_TRUE(whole.arc.is_all());
  EXPECT_TRUE(whole.arc.stays);
  EXPECT_EQ(whole.outline.centre_px, whole.before_px);
}

TEST(FindVisibleArc, FindsTheCentreOfASphereOfWhichAFifthIsHidden) {
  const VisibleArcOf hidden({.hidden_from_px = 4});
  ASSERT_TRUE(hidden.fitted);
  EXPECT_GT((hidden.before_px - kCentre).norm(), 0.5);
  EXPECT_GE(hidden.arc.hidden_count, 3);
  EXPECT_GE(hidden.arc.known_count, 8);
  // Its neighbours are left out, too.
  EXPECT_GE(std::ranges::count(hidden.arc.hidden, true), hidden.arc.hidden_count + 2);
  EXPECT_LT((hidden.outline.centre_px - kCentre).norm(), 0.15);
  EXPECT_NEAR(hidden.outline.radius_px, kRadius, 0.15);
  EXPECT_GT(hidden.arc.missing.x(), 0.1);
}

TEST(FindVisibleArc, ANotchOfTheStickTakesAFewSectors) {
  const VisibleArcOf notched({.notch_half_px = 1});
  ASSERT_TRUE(notched.fitted);
  EXPECT_GE(notched.arc.hidden_count, 1);
  EXPECT_LE(notched.arc.hidden_count, 4);
  EXPECT_LT((notched.outline.centre_px - kCentre).norm(), 0.05);
}

TEST(FindVisibleArc, ThereIsNoEdgeBeyondTheBorder) {
  const VisibleArcOf cut({.image_from_y = 15});
  ASSERT_TRUE(cut.fitted);
  EXPECT_EQ(cut.arc.hidden_count, 0);
  EXPECT_LE(cut.arc.known_count, 13);
  EXPECT_LT((cut.outline.centre_px - kCentre).norm(), 0.15);
  EXPECT_LT(cut.arc.missing.y(), -0.1);
}

TEST(FindVisibleArc, ASaturatedBackgroundHidesNothing) {
  VisibleArcOf seen({.hidden_from_px = 7});
  for (size_t i = 0; i < seen.pixels.size(); ++i) {
    seen.pixels.saturated_behind[i] = static_cast<double>(seen.pixels.x[i]) > kCentre.x() ? 1 : 0;
  }
  SphereOutline outline = seen.outline;
  const VisibleArc arc =
      FindVisibleArc(seen.pixels, seen.round, {}, seen.expected, &seen.fitter, &outline);
  EXPECT_TRUE(arc.is_all());
}

}  // namespace
}  // namespace rigcal::agent::visible_arc_test
