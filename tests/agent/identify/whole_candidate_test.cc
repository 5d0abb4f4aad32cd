// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/whole_candidate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "agent/identify/wand_verifier.h"
#include "tests/agent/identify/paper_wand_view.h"

namespace rigcal::agent::whole_candidate_test {
namespace {

constexpr size_t kHidden = 1;

// Tilted; its middle sphere is taken for hidden, with a part of it somewhere.
struct Seen {
  VerifiedWand wand;
  std::array<Eigen::Vector3d, 3> spheres_m;
  std::array<Eigen::Vector2d, 3> images_px;
  std::vector<Blob> blobs;

  Seen() {
    const Eigen::Vector3d first_m(-0.15, 0.05, 2);
    const Eigen::Vector3d along = Eigen::Vector3d(0.3, -0.05, 0.2).normalized();
    for (size_t k = 0; k < 3; ++k) {
      spheres_m[k] = first_m + PaperWand().marker_positions_m[k] * along;
      images_px[k] = kViewFocalPx * spheres_m[k].hnormalized() +
                     Eigen::Vector2d(0.5 * kViewWidth, 0.5 * kViewHeight);
      const double radius_px = 0.02 * kViewFocalPx / spheres_m[k].norm();
      Blob blob;
      blob.centre_px = images_px[k];
      if (k == kHidden) blob.centre_px.x() += 0.7 * radius_px;
      blob.area_px = static_cast<int>(std::numbers::pi * radius_px * radius_px);
      blob.second_moment_px2 = 0.25 * radius_px * radius_px * Eigen::Matrix2d::Identity();
      blobs.push_back(blob);
      wand.blobs.push_back(static_cast<int>(k));
      wand.whole.push_back(k != kHidden);
      MarkerCentre centre;
      centre.centre_px = blob.centre_px;
      centre.radius_px = radius_px;
      wand.centres.push_back(centre);
      wand.px_per_m.push_back(kViewFocalPx / spheres_m[k].norm());
    }
    wand.fit.first_m = spheres_m[0];
    wand.fit.last_m = spheres_m[2];
  }
};

TEST(WholeCandidate, IsADiscWhereThePoseSaysThatTheMarkerIs) {
  Seen seen;
  const WandFinder finder({}, PaperWand(), ViewCamera());
  const auto whole = WholeCandidate(finder, seen.wand, &seen.blobs);
  ASSERT_TRUE(whole.has_value());
  EXPECT_EQ(whole->partial, -1);
  EXPECT_EQ(whole->blobs[0], 0);
  EXPECT_EQ(whole->blobs[2], 2);
  ASSERT_EQ(seen.blobs.size(), 4u);
  ASSERT_EQ(whole->blobs[kHidden], 3);
  const Blob& disc = seen.blobs[3];
  EXPECT_LT((disc.centre_px - seen.images_px[kHidden]).norm(), 0.01);
  const double radius_px = 0.02 * kViewFocalPx / seen.spheres_m[kHidden].norm();
  EXPECT_NEAR(2 * std::sqrt(disc.second_moment_px2(0, 0)), radius_px, 0.01);
}

TEST(WholeCandidate, NoneOfAWholeWandOrBehindTheCamera) {
  const WandFinder finder({}, PaperWand(), ViewCamera());
  Seen seen;
  seen.wand.whole[kHidden] = true;
  EXPECT_FALSE(WholeCandidate(finder, seen.wand, &seen.blobs).has_value());
  seen.wand.whole[kHidden] = false;
  seen.wand.fit.last_m = -3 * seen.wand.fit.first_m;
  EXPECT_FALSE(WholeCandidate(finder, seen.wand, &seen.blobs).has_value());
  EXPECT_EQ(seen.blobs.size(), 3u);
}

// What is there decides: a whole sphere makes it a whole wand, nothing makes it none.
TEST(WholeCandidate, IsVerifiedByWhatIsThere) {
  for (const bool is_there : {true, false}) {
    Seen seen;
    std::vector<uint8_t> pixels(size_t{3} * kViewWidth * kViewHeight, 12);
    for (size_t k = 0; k < 3; ++k) {
      if (k == kHidden && !is_there) continue;
      const double radius_px = seen.wand.centres[k].radius_px;
      constexpr std::array<double, 3> kGrey = {40, 110, 200};
      for (int y = 0; y < kViewHeight; ++y) {
        for (int x = 0; x < kViewWidth; ++x) {
          const double away_px = std::hypot(x - seen.images_px[k].x(), y - seen.images_px[k].y());
          const double cover = std::clamp(radius_px - away_px + 0.5, 0.0, 1.0);
          uint8_t* const pixel =
              &pixels[3 * (static_cast<size_t>(y) * kViewWidth + static_cast<size_t>(x))];
          for (size_t c = 0; c < 3; ++c) {
            pixel[c] = static_cast<uint8_t>(pixel[c] + cover * (kGrey[c] - pixel[c]));
          }
        }
      }
    }
    const ImageView view{pixels.data(), kViewWidth, kViewHeight, ptrdiff_t{3} * kViewWidth,
                         PixelFormat::kBgr8};
    const WandFinder finder({}, PaperWand(), ViewCamera());
    const auto whole = WholeCandidate(finder, seen.wand, &seen.blobs);
    ASSERT_TRUE(whole.has_value());
    WandVerifier verifier(0.5);
    verifier.StartImage();
    double work = 20000;
    std::array<WandCandidate, 2> both = {*whole, *whole};
    std::ranges::reverse(both[1].blobs);
    Verdict verdict = verifier.Verify(view, seen.blobs, finder, both, 1, true, &work);
    ASSERT_EQ(verdict.wand.has_value(), is_there);
    if (!is_there) continue;
    EXPECT_EQ(verdict.wand->OccludedCount(), 0);
    EXPECT_EQ(verdict.wand->blobs, whole->blobs);
    EXPECT_GT(verdict.wand->label_confidence, 0.99);
    EXPECT_LT(verdict.wand->label_confidence, 1);
    // With one whole marker it is none.
    EXPECT_TRUE(verifier.FitOutlines(view, &*verdict.wand));
    verdict.wand->whole[0] = false;
    EXPECT_TRUE(verifier.FitOutlines(view, &*verdict.wand));
    verdict.wand->whole[2] = false;
    EXPECT_FALSE(verifier.FitOutlines(view, &*verdict.wand));
  }
}

}  // namespace
}  // namespace rigcal::agent::whole_candidate_test
