// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/overlapping_markers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace rigcal::agent::overlapping_markers_test {
namespace {

Blob Disc(double x, double y, double radius) {
  Blob disc;
  disc.centre_px = {x, y};
  disc.second_moment_px2 = 0.25 * radius * radius * Eigen::Matrix2d::Identity();
  disc.area_px = static_cast<int>(std::lround(std::numbers::pi * radius * radius));
  return disc;
}

VerifiedWand TwoMarkers(double apart_px) {
  VerifiedWand wand;
  wand.diameter_m = 0.04;
  for (const double px_per_m : {500.0, 490.0}) wand.px_per_m.push_back(px_per_m);
  for (const double x : {50.0, 50.0 + apart_px}) {
    wand.centres.emplace_back().centre_px = {x, 50};
  }
  return wand;
}

TEST(OverlappingMarkers, ADiscBesideCoversAPartOfWhatIsAround) {
  EXPECT_EQ(OverlapShare(Disc(50, 50, 10), Disc(80, 50, 10)), 0);
  const double share = OverlapShare(Disc(50, 50, 10), Disc(66, 50, 10));
  EXPECT_GT(share, 0.15);
  EXPECT_LT(share, 0.35);
}

TEST(OverlappingMarkers, TheFartherOneIsHidden) {
  EXPECT_EQ(HiddenShare(TwoMarkers(21), 1), 0);
  const VerifiedWand wand = TwoMarkers(10);
  EXPECT_EQ(HiddenShare(wand, 0), 0);
  // Two circles whose distance is their radius share 0.391 of each.
  EXPECT_NEAR(HiddenShare(wand, 1), 0.39, 0.03);
}

TEST(OverlappingMarkers, PixelsBeyondTheCirclesLineDoNotCount) {
  OutlinePixels pixels;
  for (const float x : {45.0f, 57.0f, 59.0f, 70.0f}) pixels.Add(x, 50, 1, 1);
  LeaveOutBeyond(Disc(50, 50, 10), Disc(66, 50, 10), &pixels);
  EXPECT_GT(pixels.precision[0], 0);
  EXPECT_GT(pixels.precision[1], 0);
  EXPECT_EQ(pixels.precision[2], 0);
  EXPECT_EQ(pixels.precision[3], 0);
}

}  // namespace
}  // namespace rigcal::agent::overlapping_markers_test
