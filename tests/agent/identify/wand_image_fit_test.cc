// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/wand_image_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace rigcal::agent::wand_image_fit_test {
namespace {

constexpr double kFocalPx = 1000, kDiameterM = 0.04;

std::vector<MarkerSight> Sights(const Eigen::Vector3d& first_m, const Eigen::Vector3d& last_m,
                                const std::vector<double>& shares) {
  std::vector<MarkerSight> sights;
  for (const double share : shares) {
    const Eigen::Vector3d x = first_m + share * (last_m - first_m);
    MarkerSight& sight = sights.emplace_back();
    sight.ray = x.normalized();
    sight.scale_px = kFocalPx;
    sight.sigma_px = 0.05;
    sight.radius_px = kFocalPx * 0.5 * kDiameterM / x.norm() + 0.1;
    sight.radius_sigma_px = 0.3;
  }
  return sights;
}

WandImageFitOptions Options() {
  WandImageFitOptions options;
  options.diameter_m = kDiameterM;
  return options;
}

TEST(FitWand, FindsPoseAndTiltOfAWandInPerspective) {
  for (const double tilt : {-1.2, -0.6, 0.0, 0.5, 1.1}) {
    const Eigen::Vector3d first(0, 0.1, 2);
    const Eigen::Vector3d last = first + 0.39 * Eigen::Vector3d(std::cos(tilt), 0, std::sin(tilt));
    const std::vector<double> shares = {0, 1.0 / 3, 1};
    WandImageFit fit;
    ASSERT_TRUE(FitWand(Sights(first, last, shares), shares, 0.39, Options(), &fit));
    EXPECT_LT(fit.cost, 0.5) << tilt;
    EXPECT_NEAR((fit.last_m - fit.first_m).norm(), 0.39, 1e-9);
    EXPECT_NEAR(fit.first_m.norm(), first.norm(), 0.1 * first.norm()) << tilt;
  }
}

TEST(FitWand, WrongWayRoundAndWrongSpacingCost) {
  const Eigen::Vector3d first(-0.2, 0, 2), last(0.19, 0, 2);
  const std::vector<double> shares = {0, 1.0 / 3, 1};
  const auto sights = Sights(first, last, shares);
  const std::vector<MarkerSight> reversed(sights.rbegin(), sights.rend());
  WandImageFit fit;
  EXPECT_TRUE(!FitWand(reversed, shares, 0.39, Options(), &fit) || fit.cost > 50);
  // Twice as long with spheres of that size: the images are too large for the distance.
  EXPECT_TRUE(!FitWand(sights, shares, 0.9, Options(), &fit) || fit.cost > 20);
}

TEST(FitWand, AMarkerBesideTheLineCosts) {
  const std::vector<double> shares = {0, 1.0 / 3, 1};
  auto sights = Sights({-0.2, 0, 2}, {0.19, 0, 2}, shares);
  sights[1].ray = (sights[1].ray + Eigen::Vector3d(0, 0.006, 0)).normalized();  // 6 px
  WandImageFit fit;
  ASSERT_TRUE(FitWand(sights, shares, 0.39, Options(), &fit));
  EXPECT_GT(fit.cost, 20);
}

TEST(FitWand, KeepsTheLimitsOfDistance) {
  const std::vector<double> shares = {0, 1.0 / 3, 1};
  const auto sights = Sights({-0.2, 0, 2}, {0.19, 0, 2}, shares);
  WandImageFitOptions options = Options();
  options.max_distance_m = 0.5;
  options.max_tilt_rad = 0.3;
  WandImageFit fit;
  EXPECT_FALSE(FitWand(sights, shares, 0.39, options, &fit));
  EXPECT_FALSE(FitWand({sights[0], sights[0], sights[0]}, shares, 0.39, Options(), &fit));
}

TEST(FitWand, WithoutDiameterOnlyRatiosOfRadiiCount) {
  const std::vector<double> shares = {0, 1.0 / 3, 1};
  auto sights = Sights({-0.2, 0, 2}, {0.19, 0, 2}, shares);
  WandImageFitOptions options = Options();
  options.diameter_m = 0;
  for (MarkerSight& sight : sights) sight.radius_px = 30;
  WandImageFit fit;
  ASSERT_TRUE(FitWand(sights, shares, 0.39, options, &fit));
  EXPECT_LT(fit.cost, 1);
  sights[2].radius_px = 60;
  EXPECT_TRUE(!FitWand(sights, shares, 0.39, options, &fit) || fit.cost > 20);
}

}  // namespace
}  // namespace rigcal::agent::wand_image_fit_test
