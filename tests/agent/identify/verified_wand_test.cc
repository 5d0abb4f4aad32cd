// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/verified_wand.h"

#include <gtest/gtest.h>

#include <vector>

namespace rigcal::agent::verified_wand_test {
namespace {

VerifiedWand WandOf(const std::vector<double>& sigmas_px, const std::vector<double>& radii_px) {
  VerifiedWand wand;
  for (size_t k = 0; k < sigmas_px.size(); ++k) {
    MarkerCentre& centre = wand.centres.emplace_back();
    centre.radius_px = radii_px[k];
    centre.covariance_px2 = sigmas_px[k] * sigmas_px[k] * Eigen::Matrix2d::Identity();
    wand.whole.push_back(true);
  }
  return wand;
}

TEST(VerifiedWand, TheLargestSigmaIsInRadiiOfItsOwnMarker) {
  const VerifiedWand wand = WandOf({0.3, 0.2, 0.1}, {6, 2, 4});
  EXPECT_NEAR(wand.LargestSigmaRadii(), 0.1, 1e-12);
}

TEST(VerifiedWand, AMarkerThatIsNotSeenWholeHasNoSigma) {
  VerifiedWand wand = WandOf({0.3, 2, 0.1}, {6, 2, 4});
  wand.whole[1] = false;
  EXPECT_NEAR(wand.LargestSigmaRadii(), 0.05, 1e-12);
  wand.whole[0] = wand.whole[2] = false;
  EXPECT_EQ(wand.LargestSigmaRadii(), 0);
}

}  // namespace
}  // namespace rigcal::agent::verified_wand_test
