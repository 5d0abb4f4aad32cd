// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/spot_finder.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/testing/status_matchers.h"

namespace rigcal::agent::spot_finder_test {
namespace {

constexpr int kWidth = 640, kHeight = 480;

struct Bgr {
  uint8_t blue, green, red;
};
constexpr Bgr kSphere{40, 110, 220};

// Of one grey.
class Picture {
 public:
  explicit Picture(uint8_t grey) : pixels_(size_t{3} * kWidth * kHeight, grey) {}

  void Fill(int x0, int y0, int width, int height, const Bgr& colour) {
    for (int y = y0; y < y0 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) Set(x, y, colour);
    }
  }
  void AddDisc(int x0, int y0, double radius_px, const Bgr& colour) {
    const int reach = static_cast<int>(radius_px) + 1;
    for (int y = -reach; y <= reach; ++y) {
      for (int x = -reach; x <= reach; ++x) {
        if (std::hypot(x, y) <= radius_px) Set(x0 + x, y0 + y, colour);
      }
    }
  }
  ImageView View() const {
    return {pixels_.data(), kWidth, kHeight, kWidth * 3, PixelFormat::kBgr8};
  }

 private:
  void Set(int x, int y, const Bgr& colour) {
    uint8_t* const pixel = &pixels_[static_cast<size_t>((y * kWidth + x) * 3)];
    pixel[0] = colour.blue, pixel[1] = colour.green, pixel[2] = colour.red;
  }

  std::vector<uint8_t> pixels_;
};

SpotFinder MustCreate() {
  auto finder = SpotFinder::Create(BlobFinderOptions());
  EXPECT_THAT(finder, ::rigcal::testing::IsOk());
  return *std::move(finder);
}

double RadiusPx(const Spot& spot) { return std::sqrt(spot.blob.area_px / std::numbers::pi); }

std::vector<Spot> SpotsAt(const SpotFinder& finder, double x, double y, double within_px) {
  std::vector<Spot> spots;
  std::ranges::copy_if(finder.spots(), std::back_inserter(spots), [&](const Spot& spot) {
    return !spot.is_half && (spot.blob.centre_px - Eigen::Vector2d(x, y)).norm() < within_px;
  });
  return spots;
}

// The disc, and the disc with a part of what it lies on, are pieces of the same patch.
TEST(SpotFinder, OfTwoPiecesOfOneThingTheRounderIsKept) {
  SpotFinder finder = MustCreate();
  for (int beyond = 8; beyond <= 14; beyond += 2) {
    Picture picture(20);
    picture.Fill(240, 198, 6 + beyond, 5, kSphere);
    picture.AddDisc(240, 200, 6, kSphere);
    finder.BeginImage();
    finder.Find(picture.View(), picture.View().Bounds(), 0);
    const std::vector<Spot> spots = SpotsAt(finder, 240, 200, 5);
    ASSERT_EQ(spots.size(), 1u) << beyond;
    EXPECT_LT((spots[0].blob.centre_px - Eigen::Vector2d(240, 200)).norm(), 0.8) << beyond;
    EXPECT_NEAR(RadiusPx(spots[0]), 6, 0.8) << beyond;
  }
}

TEST(SpotFinder, OfTooManySpotsTheLeastDoubtfulAreKept) {
  SpotFinder finder = MustCreate();
  Picture picture(20);
  // Brighter than the discs, but small.
  for (int y = 20; y < 460; y += 20) {
    for (int x = 20; x < 620; x += 20) picture.Fill(x, y, 3, 3, {60, 140, 245});
  }
  for (const int x : {111, 311, 511}) picture.AddDisc(x, 231, 7, {20, 60, 130});
  finder.BeginImage();
  finder.Find(picture.View(), picture.View().Bounds(), 0);
  EXPECT_FALSE(finder.has_all());
  EXPECT_LE(finder.spots().size(), 200u);
  for (const int x : {111, 311, 511}) EXPECT_EQ(SpotsAt(finder, x, 231, 1).size(), 1u) << x;
  const double most = std::ranges::max(finder.spots(), {}, &Spot::doubt).doubt;
  EXPECT_GE(finder.least_doubt_left(), most);
}

// More of the wand's hue than the spheres, which white light makes bright in all channels.
TEST(SpotFinder, APaleDiscBeforeItsOwnHueIsFoundByItsWhite) {
  SpotFinder finder = MustCreate();
  Picture picture(20);
  picture.Fill(0, 0, kWidth, kHeight, {15, 40, 220});
  picture.AddDisc(300, 200, 7, {110, 145, 210});
  finder.BeginImage();
  finder.Look(picture.View());
  finder.Find(picture.View(), picture.View().Bounds(), 0);
  EXPECT_TRUE(SpotsAt(finder, 300, 200, 2).empty());
  finder.Find(picture.View(), picture.View().Bounds(), SpotFinder::kWhitenedLevel);
  ASSERT_EQ(SpotsAt(finder, 300, 200, 0.5).size(), 1u);
  // What is white has not the wand's colour.
  picture.AddDisc(300, 200, 7, {200, 205, 210});
  finder.BeginImage();
  finder.Find(picture.View(), picture.View().Bounds(), SpotFinder::kWhitenedLevel);
  EXPECT_TRUE(SpotsAt(finder, 300, 200, 2).empty());
}

// Half as bright as configured.
TEST(SpotFinder, ADimDiscIsFoundInTheDimLevelOnly) {
  SpotFinder finder = MustCreate();
  Picture picture(20);
  picture.AddDisc(300, 200, 7, {8, 26, 45});
  for (const size_t level : {size_t{0}, SpotFinder::kPaleLevels[1], SpotFinder::kDimLevel}) {
    finder.BeginImage();
    finder.Look(picture.View());
    finder.Find(picture.View(), picture.View().Bounds(), level);
    EXPECT_EQ(SpotsAt(finder, 300, 200, 0.5).size(), level == SpotFinder::kDimLevel ? 1u : 0u);
  }
}

// What it adds to an orange wall is nearly yellow, but it is orange itself.
TEST(SpotFinder, ADiscOfTheWandsColourBeforeItsOwnColourStandsOut) {
  SpotFinder finder = MustCreate();
  for (const bool is_orange : {true, false}) {
    Picture picture(20);
    picture.Fill(100, 100, 400, 300, {10, 37, 128});
    picture.AddDisc(300, 200, 7, is_orange ? Bgr{53, 139, 215} : Bgr{90, 215, 150});
    finder.BeginImage();
    finder.Find(picture.View(), picture.View().Bounds(), SpotFinder::kContrastLevel);
    EXPECT_EQ(SpotsAt(finder, 300, 200, 0.5).size(), is_orange ? 1u : 0u);
  }
}

// Its light adds little to a wall that is as bright as any sphere, or has its hue.
TEST(SpotFinder, ADiscThatAddsLittleToAWallIsFoundByItsContrast) {
  SpotFinder finder = MustCreate();
  for (const Bgr& wall : {Bgr{120, 120, 120}, Bgr{40, 80, 120}}) {
    const auto add = [&](int blue, int green, int red) {
      return Bgr{static_cast<uint8_t>(wall.blue + blue), static_cast<uint8_t>(wall.green + green),
                 static_cast<uint8_t>(wall.red + red)};
    };
    Picture picture(0);
    picture.Fill(0, 0, kWidth, kHeight, wall);
    picture.AddDisc(300, 200, 7, add(2, 10, 20));
    picture.AddDisc(400, 200, 7, add(30, 40, 50));
    picture.AddDisc(100, 200, 7, add(30, 30, 30));  // white
    picture.AddDisc(200, 200, 7, add(10, 0, 22));   // pink
    picture.AddDisc(100, 300, 7, add(10, 30, 22));  // green
    picture.AddDisc(200, 300, 7, add(1, 4, 8));     // next to nothing
    for (const size_t level : {size_t{0}, SpotFinder::kPaleLevels[1], SpotFinder::kContrastLevel}) {
      finder.BeginImage();
      finder.Look(picture.View());
      finder.Find(picture.View(), picture.View().Bounds(), level);
      const size_t expected = level == SpotFinder::kContrastLevel ? 1 : 0;
      EXPECT_EQ(SpotsAt(finder, 300, 200, 0.6).size(), expected);
      EXPECT_EQ(SpotsAt(finder, 400, 200, 0.6).size(), expected);
    }
    EXPECT_EQ(finder.spots().size(), 2u);
  }
}

// White light that a thing does not reflect is no light of the wand.
TEST(SpotFinder, ABlackDiscBeforeABluishWallIsNoSpot) {
  SpotFinder finder = MustCreate();
  Picture picture(0);
  picture.Fill(0, 0, kWidth, kHeight, {70, 60, 52});
  picture.AddDisc(300, 200, 7, {6, 6, 6});
  picture.AddDisc(400, 200, 7, {70, 78, 84});
  finder.BeginImage();
  finder.Find(picture.View(), picture.View().Bounds(), SpotFinder::kContrastLevel);
  EXPECT_TRUE(SpotsAt(finder, 300, 200, 3).empty());
  EXPECT_EQ(SpotsAt(finder, 400, 200, 0.6).size(), 1u);
}

// Of one wand a sphere may stand out by its colour only, and another one by nothing else: the
// second picture stands for what contrast does not show. Nothing is kept of another image.
TEST(SpotFinder, WhatTheLevelBeforeFoundIsKeptBesideWhatStandsOut) {
  SpotFinder finder = MustCreate();
  Picture by_colour(20), by_contrast(20);
  by_colour.AddDisc(200, 200, 7, kSphere);
  by_colour.AddDisc(300, 200, 7, kSphere);
  by_contrast.AddDisc(301, 200, 7, kSphere);
  by_contrast.AddDisc(400, 200, 7, kSphere);
  const PixelRect all = by_colour.View().Bounds();
  for (const bool same_image : {true, false}) {
    finder.BeginImage();
    finder.Find(by_colour.View(), all, 0);
    if (!same_image) finder.BeginImage();
    finder.Find(by_contrast.View(), all, SpotFinder::kContrastLevel);
    EXPECT_EQ(SpotsAt(finder, 200, 200, 2).size(), same_image ? 1u : 0u);
    EXPECT_EQ(SpotsAt(finder, 300, 200, 3).size(), 1u);
    EXPECT_EQ(SpotsAt(finder, 400, 200, 2).size(), 1u);
  }
  // A part of an image is searched for itself.
  finder.BeginImage();
  finder.Find(by_colour.View(), all, 0);
  finder.Find(by_contrast.View(), {350, 150, 100, 100}, SpotFinder::kContrastLevel);
  EXPECT_TRUE(SpotsAt(finder, 200, 200, 2).empty());
}

// A pattern all over leaves no time for other levels.
TEST(SpotFinder, OfAPatternNothingStandsOutIfOnlyAFewMay) {
  SpotFinder finder = MustCreate();
  Picture picture(20);
  for (int y = 10; y < kHeight - 10; y += 14) {
    for (int x = 10; x < kWidth - 10; x += 14) picture.AddDisc(x, y, 4, {20, 60, 130});
  }
  for (const bool only_if_few : {false, true}) {
    finder.BeginImage();
    finder.Find(picture.View(), picture.View().Bounds(), SpotFinder::kContrastLevel, only_if_few);
    EXPECT_GT(finder.result().over_limit, 0);
    EXPECT_EQ(finder.spots().empty(), only_if_few);
  }
}

}  // namespace
}  // namespace rigcal::agent::spot_finder_test
