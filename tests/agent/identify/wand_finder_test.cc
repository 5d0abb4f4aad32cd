// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_finder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace rigcal::agent::wand_finder_test {
namespace {

CameraDescription Camera() {
  CameraDescription camera;
  camera.camera = "test";
  camera.image_size_px = {1280, 1024};
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = 1000;
  intrinsics.cx_px = 640;
  intrinsics.cy_px = 512;
  camera.intrinsics = intrinsics;
  return camera;
}

Target WandOf(const std::vector<double>& positions_m) {
  Target target;
  target.marker_positions_m = positions_m;
  target.diameter_m = 0.04;
  return target;
}

Blob Disc(double x, double y, double radius_px) {
  Blob blob;
  blob.centre_px = {x, y};
  blob.second_moment_px2 = 0.25 * radius_px * radius_px * Eigen::Matrix2d::Identity();
  blob.area_px = static_cast<int>(std::numbers::pi * radius_px * radius_px);
  return blob;
}

// A wand at 2 m, seen from the front.
std::vector<Blob> Wand(const Target& target, double x, double y) {
  std::vector<Blob> blobs;
  for (const double at_m : target.marker_positions_m) blobs.push_back(Disc(x + 500 * at_m, y, 10));
  return blobs;
}

TEST(WandFinder, FindsMarkersAmongLargerBlobsAndTellsTheEnds) {
  const Target target = WandOf({0, 0.13, 0.39});
  std::vector<Blob> blobs = {Disc(100, 100, 40), Disc(700, 900, 35), Disc(1000, 300, 50)};
  for (const Blob& blob : Wand(target, 400, 500)) blobs.push_back(blob);
  WandFinder finder({}, target, Camera());
  const auto& found = finder.Find(blobs);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found[0].blobs, (absl::InlinedVector<int, 3>{3, 4, 5}));
  EXPECT_NEAR(found[0].fit.first_m.norm(), 2, 0.2);
}

TEST(WandFinder, WandsOfTwoFiveAndSixteenMarkers) {
  for (const int count : {2, 5, 16}) {
    std::vector<double> positions_m = {0};
    for (int k = 1; k < count; ++k) {
      positions_m.push_back(positions_m.back() + 0.06 + 0.01 * (k % 3));
    }
    const Target target = WandOf(positions_m);
    WandFinder finder({}, target, Camera());
    const auto blobs = Wand(target, 300, 400);
    const auto& found = finder.Find(blobs);
    ASSERT_FALSE(found.empty()) << count;
    ASSERT_EQ(static_cast<int>(found[0].blobs.size()), count);
    if (count == 2) continue;  // either way round
    for (int k = 0; k < count; ++k) EXPECT_EQ(found[0].blobs[static_cast<size_t>(k)], k);
  }
}

TEST(WandFinder, KindsTellTheEndsOfAnEvenWand) {
  const Target target = WandOf({0, 0.13, 0.26, 0.39});
  WandFinderOptions options;
  options.marker_kinds = {0, 1, 1, 2};
  WandFinder finder(options, target, Camera());
  std::vector<Blob> blobs = Wand(target, 400, 500);
  blobs.push_back(Disc(465, 501, 10));  // of no marker's kind there
  const auto& found = finder.Find(blobs, {2, 1, 1, 0, 0});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].blobs, (absl::InlinedVector<int, 3>{3, 2, 1, 0}));
  EXPECT_TRUE(finder.Find(blobs, {2, 1, 0, 0, 0}).empty());
  EXPECT_TRUE(finder.Find(blobs, {2, 1, 1, 2, 0}).empty());
}

TEST(WandFinder, BlobsTooLargeForTheirDistanceOrBesideTheLineAreNoWand) {
  const Target target = WandOf({0, 0.13, 0.39});
  WandFinder finder({}, target, Camera());
  const double fitting = finder.Find(Wand(target, 400, 500)).at(0).fit.cost;
  const auto& large = finder.Find({Disc(400, 500, 40), Disc(465, 500, 40), Disc(595, 500, 40)});
  EXPECT_TRUE(large.empty() || large[0].fit.cost > fitting + 10);
  EXPECT_TRUE(finder.Find({Disc(400, 500, 10), Disc(465, 560, 10), Disc(595, 500, 10)}).empty());
}

TEST(WandFinder, TriesNoMorePosesThanAllowed) {
  std::vector<Blob> lattice;
  for (int i = 0; i < 256; ++i) lattice.push_back(Disc(300 + 8 * (i % 16), 300 + 8 * (i / 16), 2));
  WandFinderOptions options;
  options.max_candidates = 100000;
  const auto count = [&](int max_fits) {
    options.max_fits = max_fits;
    WandFinder finder(options, WandOf({0, 0.13, 0.39}), Camera());
    const size_t first = finder.Find(lattice).size();
    EXPECT_EQ(finder.Find(lattice).size(), first);  // anew with each Find
    return first;
  };
  EXPECT_EQ(count(0), 0u);
  const size_t few = count(2000);
  EXPECT_GT(few, 0u);
  EXPECT_LE(few, 2000u);
  EXPECT_GT(count(10000), few);
}

TEST(WandFinder, NothingFromNothingAndFromNonsense) {
  const Target target = WandOf({0, 0.13, 0.39});
  WandFinder finder({}, target, Camera());
  EXPECT_TRUE(finder.Find({}).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(finder.Find({Disc(nan, 0, 10), Disc(1, nan, 10), Disc(5, 5, 10)}).empty());
  // All in one place.
  EXPECT_TRUE(finder.Find({Disc(5, 5, 10), Disc(5, 5, 10), Disc(5, 5, 10)}).empty());
}

}  // namespace
}  // namespace rigcal::agent::wand_finder_test
