// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/partial_wands.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <vector>

#include "agent/identify/hidden_part.h"
#include "agent/identify/verified_wand.h"
#include "tests/agent/identify/paper_wand_view.h"

namespace rigcal::agent::partial_wands_test {
namespace {

constexpr double kRadius = 10;  // of a sphere of 40 mm at 2 m

// Orange discs in the dark.
class Discs {
 public:
  Discs() : pixels_(size_t{3} * kViewWidth * kViewHeight, 12) {}

  void Add(double x, double y) {
    Draw(x, y, kRadius);
    Blob blob;
    blob.centre_px = {x, y};
    blob.second_moment_px2 = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
    blob.area_px = static_cast<int>(std::numbers::pi * kRadius * kRadius);
    wholes_.push_back({blob, {kGrey[0], kGrey[1], kGrey[2]}});
  }

  // Of a disc what is right of its middle.
  void AddHalf(double x, double y) { Draw(x, y, kRadius, x); }
  // Of one beyond the border what is in the image.
  void AddCut(double x, double y) { Draw(x, y, kRadius); }

  // A whole one that nothing found, with more of its look around it than a marker has.
  void AddAmongLike(double x, double y) {
    Draw(x, y, 1.8 * kRadius, x + 0.5 * kRadius);
    Draw(x, y, kRadius + 4, 0, kDark);
    Draw(x, y, kRadius);
    Draw(x, y - 1.5 * kRadius, 6);
    Draw(x, y + 1.5 * kRadius, 6);
  }

  PartialWands Search(double work, bool look_for_third = false) const {
    const ImageView view{pixels_.data(), kViewWidth, kViewHeight, ptrdiff_t{3} * kViewWidth,
                         PixelFormat::kBgr8};
    return FindPartialWands(view, WandFinder({}, PaperWand(), ViewCamera()), wholes_, {}, 100,
                            &work, look_for_third);
  }

 private:
  static constexpr std::array<uint8_t, 3> kGrey = {40, 110, 200}, kDark = {12, 12, 12};

  void Draw(double x, double y, double radius, double from_x = 0,
            const std::array<uint8_t, 3>& grey = kGrey) {
    for (int v = 0; v < kViewHeight; ++v) {
      for (int u = 0; u < kViewWidth; ++u) {
        if (u < from_x || (u - x) * (u - x) + (v - y) * (v - y) > radius * radius) continue;
        std::copy(grey.begin(), grey.end(),
                  &pixels_[3 * (static_cast<size_t>(v) * kViewWidth + static_cast<size_t>(u))]);
      }
    }
  }

  std::vector<uint8_t> pixels_;
  std::vector<WholeMarker> wholes_;
};

TEST(FindPartialWands, FindsAWandOfWhichHalfOfASphereIsSeen) {
  Discs discs;
  discs.Add(200, 240);
  discs.AddHalf(265, 240);
  discs.Add(395, 240);
  const PartialWands found = discs.Search(3000);
  ASSERT_FALSE(found.candidates.empty());
  EXPECT_EQ(found.candidates[0].partial, 1);
  EXPECT_EQ(found.candidates[0].blobs[0], 0);
  EXPECT_EQ(found.candidates[0].blobs[2], 1);
  EXPECT_FALSE(found.cut_short);
}

// What the border leaves of a marker is up to a radius away from its middle.
TEST(FindPartialWands, AMarkerBeyondTheBorderFitsThePose) {
  Discs discs;
  discs.Add(449, 240);
  discs.Add(514, 240);
  discs.AddCut(644, 240);  // a sixth of it is in the image
  const PartialWands found = discs.Search(3000);
  ASSERT_FALSE(found.candidates.empty());
  EXPECT_EQ(found.candidates[0].partial, 2);
  EXPECT_LT(found.candidates[0].fit.cost, 0.1);
}

TEST(FindPartialWands, FindsAWholeMarkerThatNothingFoundWhereTheOthersSay) {
  Discs discs;
  discs.Add(200, 240);
  discs.Add(265, 240);
  discs.AddAmongLike(395, 240);
  EXPECT_TRUE(discs.Search(3000).thirds.empty());
  const PartialWands found = discs.Search(3000, true);
  ASSERT_FALSE(found.thirds.empty());
  const WandCandidate& wand = found.thirds[0];
  EXPECT_EQ(wand.partial, -1);
  ASSERT_EQ(wand.blobs.size(), 3);
  EXPECT_EQ(wand.blobs[0], 0);
  EXPECT_EQ(wand.blobs[1], 1);
  const Blob& third = found.blobs[static_cast<size_t>(wand.blobs[2])];
  EXPECT_LT((third.centre_px - Eigen::Vector2d(395, 240)).norm(), 0.3 * kRadius);
  EXPECT_NEAR(third.area_px, std::numbers::pi * kRadius * kRadius, 40);
}

// Of a marker whose middle is so far beyond the image's left border a part is left.
TEST(MiddleBeyondBorder, IsThatOfTheDisc) {
  const std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  for (const double beyond_px : {-0.5 * kRadius, 0.0, 0.4 * kRadius, 0.8 * kRadius}) {
    const Eigen::Vector2d middle(-0.5 - beyond_px, 50);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    int count = 0;  // of a tenth of a pixel
    for (double x = -0.45; x < 20; x += 0.1) {
      for (double y = 30; y < 70; y += 0.1) {
        if ((Eigen::Vector2d(x, y) - middle).norm() > kRadius) continue;
        sum += Eigen::Vector2d(x, y);
        ++count;
      }
    }
    Blob part;
    part.centre_px = sum / count;
    part.area_px = count / 100;
    const Eigen::Vector2d place = middle + Eigen::Vector2d(0.2 * kRadius, 0);
    EXPECT_LT((MiddleBeyondBorder(view, part, place, kRadius) - middle).norm(), 0.06 * kRadius);
  }
  Blob inside;
  inside.centre_px = {50, 50};
  inside.area_px = 100;
  EXPECT_EQ(MiddleBeyondBorder(view, inside, {52, 50}, kRadius), inside.centre_px);
}

// A disc of the markers' look whose middle is beyond the right border.
bool SeesBeyondBorder(double beyond_px) {
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  const Eigen::Vector2d middle(99.5 + beyond_px, 50);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      if ((Eigen::Vector2d(x, y) - middle).norm() > kRadius) continue;
      uint8_t* const pixel = &pixels[3 * (static_cast<size_t>(y) * 100 + static_cast<size_t>(x))];
      pixel[0] = 40, pixel[1] = 110, pixel[2] = 200;
    }
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  double work = 3000;
  return LookForPart(view, middle, kRadius, {40, 110, 200}, false, &work).has_value();
}

TEST(LookForPart, ATenthOfADiscWithinTheImageIsEnough) {
  EXPECT_TRUE(SeesBeyondBorder(0.3 * kRadius));
  EXPECT_TRUE(SeesBeyondBorder(0.65 * kRadius));   // a tenth
  EXPECT_FALSE(SeesBeyondBorder(0.85 * kRadius));  // a thirtieth
}

// A disc of the markers' look in front of something as bright all around it, or on it only, of
// which a dark bar hides the left half.
std::optional<HiddenPart> PartBefore(bool is_window) {
  const Eigen::Vector2d middle_px(100, 100);
  std::vector<uint8_t> pixels(size_t{3} * 200 * 200, 12);
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      const double away_px = (Eigen::Vector2d(x, y) - middle_px).norm();
      const bool is_bar = x > 70 && x < 100;
      uint8_t* const pixel = &pixels[3 * (static_cast<size_t>(y) * 200 + static_cast<size_t>(x))];
      if (!is_bar && (is_window || away_px < 1.35 * kRadius)) std::fill_n(pixel, 3, 250);
      if (!is_bar && away_px < kRadius) pixel[0] = 40, pixel[1] = 110, pixel[2] = 200;
    }
  }
  const ImageView view{pixels.data(), 200, 200, 600, PixelFormat::kBgr8};
  double work = 3000;
  // The place is not known exactly: what is behind is seen past the marker.
  return LookForPart(view, middle_px + Eigen::Vector2d(0.3 * kRadius, 0), kRadius, {40, 110, 200},
                     false, &work);
}

// A crescent of the markers' look, two pixels wide, between a dark bar and something brighter.
bool SeesCrescent(bool has_stick) {
  constexpr double kSmall = 6;
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  for (int y = 0; y < 100; ++y) {
    for (int x = 54; x < 100; ++x) {
      uint8_t* const pixel = &pixels[3 * (static_cast<size_t>(y) * 100 + static_cast<size_t>(x))];
      std::fill_n(pixel, 3, 250);
      if (std::hypot(x - 50, y - 50) < kSmall) pixel[0] = 40, pixel[1] = 110, pixel[2] = 200;
    }
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  double work = 3000;
  return LookForPart(view, {50, 50}, kSmall, {40, 110, 200}, has_stick, &work).has_value();
}

TEST(LookForPart, BesideAStickItMayBeAsThinAsARim) {
  EXPECT_FALSE(SeesCrescent(false));
  EXPECT_TRUE(SeesCrescent(true));
}

TEST(LookForPart, WhatIsBrightAllAroundIsSeenPastTheMarker) {
  EXPECT_TRUE(PartBefore(true));
  EXPECT_FALSE(PartBefore(false));  // a label with a rim
}

// Half of a disc, and a bar of its look that leads away from it.
bool SeesPartWithBar(double half_width_px) {
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  for (int y = 0; y < 100; ++y) {
    for (int x = 50; x < 100; ++x) {
      if (std::hypot(x - 50, y - 50) > kRadius && std::abs(y - 50) > half_width_px) continue;
      uint8_t* const pixel = &pixels[3 * (static_cast<size_t>(y) * 100 + static_cast<size_t>(x))];
      pixel[0] = 40, pixel[1] = 110, pixel[2] = 200;
    }
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  double work = 3000;
  return LookForPart(view, {50, 50}, kRadius, {40, 110, 200}, true, &work).has_value();
}

// What is within `centre` and `radius_px`, and right of `from_x`, of a marker in the middle.
bool SeesDisc(const Eigen::Vector2d& centre, double radius_px, double from_x) {
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      if (x < from_x || (Eigen::Vector2d(x, y) - centre).norm() > radius_px) continue;
      uint8_t* const pixel = &pixels[3 * (static_cast<size_t>(y) * 100 + static_cast<size_t>(x))];
      pixel[0] = 40, pixel[1] = 110, pixel[2] = 200;
    }
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  double work = 3000;
  return LookForPart(view, {50, 50}, kRadius, {40, 110, 200}, true, &work).has_value();
}

// What hides a marker has an edge: it leaves less than half of it long and narrow.
TEST(LookForPart, ASmallerDiscIsNone) {
  EXPECT_TRUE(SeesDisc({50, 50}, kRadius, 52));
  EXPECT_TRUE(SeesDisc({50, 50}, 0.75 * kRadius, 0));
  EXPECT_FALSE(SeesDisc({50, 50}, 0.5 * kRadius, 0));
  EXPECT_FALSE(SeesDisc({52, 51}, 0.5 * kRadius, 0));
}

// A stick does, too, but not so wide: it would be taken for the marker in the middle.
TEST(LookForPart, WhatGoesOnIsNone) {
  EXPECT_TRUE(SeesPartWithBar(4));
  EXPECT_FALSE(SeesPartWithBar(7.4));
}

TEST(LookForSliver, BesideAStickLessIsEnough) {
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100, 12);
  for (const size_t y : {48, 49, 50, 51}) {
    uint8_t* const pixel = &pixels[3 * (y * 100 + 52)];
    pixel[0] = 12 + 6, pixel[1] = 12 + 23, pixel[2] = 12 + 44;  // a quarter of the way
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  for (const bool has_stick : {false, true}) {
    double work = 3000;
    const auto part = LookForSliver(view, {50, 50}, 3.5, {40, 110, 200}, has_stick, &work);
    ASSERT_EQ(part.has_value(), has_stick);
    if (part) {
      EXPECT_TRUE(part->is_sliver);
    }
  }
}

// A column of pixels that are covered so far, before rows that differ by some of the way to a
// marker.
bool SeesSliver(double cover, double rows, bool has_stick) {
  std::vector<uint8_t> pixels(size_t{3} * 100 * 100);
  const std::array<double, 3> way = {28, 98, 188};
  for (size_t y = 0; y < 100; ++y) {
    for (size_t x = 0; x < 100; ++x) {
      const bool is_sliver = x == 52 && y >= 48 && y <= 51;
      const double share = is_sliver ? cover : (y / 2 % 2 == 0 ? 0 : rows);
      for (size_t c = 0; c < 3; ++c) {
        pixels[3 * (100 * y + x) + c] = static_cast<uint8_t>(12 + share * way[c]);
      }
    }
  }
  const ImageView view{pixels.data(), 100, 100, 300, PixelFormat::kBgr8};
  double work = 3000;
  return LookForSliver(view, {50, 50}, 3.5, {40, 110, 200}, has_stick, &work).has_value();
}

TEST(LookForSliver, OfAnEvenSurfaceLittleIsEnough) {
  EXPECT_TRUE(SeesSliver(0.18, 0, true));
  EXPECT_FALSE(SeesSliver(0.11, 0, true));
  EXPECT_TRUE(SeesSliver(0.28, 0, false));
  EXPECT_FALSE(SeesSliver(0.22, 0, false));
  EXPECT_FALSE(SeesSliver(0.28, 0.15, false));
}

TEST(LookForSliver, TheMoreUnevenItIsThereTheMoreMustBeSeen) {
  EXPECT_TRUE(SeesSliver(0.8, 0.26, false));
  EXPECT_FALSE(SeesSliver(0.5, 0.26, false));
  EXPECT_FALSE(SeesSliver(1, 0.36, false));
}

VerifiedWand WandAt(const std::array<double, 3>& places_px, int hidden) {
  VerifiedWand wand;
  for (const double x_px : places_px) {
    MarkerCentre centre;
    centre.centre_px = {x_px, 0};
    centre.radius_px = kRadius;
    wand.centres.push_back(centre);
    wand.blobs.push_back(static_cast<int>(x_px));
    wand.whole.push_back(static_cast<int>(wand.whole.size()) != hidden);
  }
  return wand;
}

// A wand of two spheres of another one, and what is beside them.
TEST(IsPartOf, ItsSpheresAreAnothersOfWhichOneMoreIsSeen) {
  const VerifiedWand wand = WandAt({100, 165, 295}, 1);
  EXPECT_TRUE(IsPartOf(WandAt({100, 170, 200}, 2), wand));   // the part is taken for a marker
  EXPECT_FALSE(IsPartOf(WandAt({100, 120, 295}, 1), wand));  // the same two
  EXPECT_FALSE(IsPartOf(WandAt({100, 295, 600}, 2), wand));  // as other markers
  EXPECT_FALSE(IsPartOf(WandAt({100, 400, 500}, 2), wand));  // another thing
  EXPECT_FALSE(IsPartOf(WandAt({100, 165, 295}, -1), wand));
}

TEST(SamePlaces, APartIsSomewhereWithinItsMarker) {
  VerifiedWand one;
  for (const double x_px : {0.0, 65.0, 195.0}) {
    MarkerCentre centre;
    centre.centre_px = {x_px, 0};
    centre.radius_px = kRadius;
    one.centres.push_back(centre);
    one.blobs.push_back(static_cast<int>(one.blobs.size()));
    one.whole.push_back(true);
  }
  VerifiedWand other = one;
  other.centres[2].centre_px.x() += 1.1 * kRadius;
  EXPECT_FALSE(SamePlaces(one, other));
  other.whole[2] = false;
  EXPECT_TRUE(SamePlaces(one, other));
  other.centres[2].centre_px.x() += 0.5 * kRadius;
  EXPECT_FALSE(SamePlaces(one, other));
}

// In a room with lamps and labels there are many pairs of things that are alike.
TEST(FindPartialWands, PlacesWhereNothingIsCostLittle) {
  Discs discs;
  for (int i = 0; i < 4; ++i) {
    discs.Add(130 + 61 * i, 90);
    discs.Add(150 + 58 * i, 400);
  }
  const PartialWands found = discs.Search(8000);
  EXPECT_GT(found.tried, 100);
}

TEST(LeastPartialConfidence, GrowsWithThePlacesThatWereTried) {
  EXPECT_NEAR(LeastPartialConfidence(0, false), 0.88, 1e-9);
  EXPECT_GT(LeastPartialConfidence(100, false), 0.91);
  EXPECT_GT(LeastPartialConfidence(400, false), 0.95);
  EXPECT_LT(LeastPartialConfidence(400, false), 0.97);  // a wand in a cluttered room is found
}

// There outlines say more of a wand, and more things are found by chance.
TEST(LeastPartialConfidence, GrowsFasterInALitRoom) {
  EXPECT_NEAR(LeastPartialConfidence(0, true), 0.88, 1e-9);
  EXPECT_GT(LeastPartialConfidence(400, true), 0.99);
  EXPECT_LT(LeastPartialConfidence(400, true), 0.997);
}

}  // namespace
}  // namespace rigcal::agent::partial_wands_test
