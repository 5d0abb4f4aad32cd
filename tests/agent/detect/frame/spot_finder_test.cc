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
    return (spot.blob.centre_px - Eigen::Vector2d(x, y)).norm() < within_px;
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

}  // namespace
}  // namespace rigcal::agent::spot_finder_test
