// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/edge_profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace rigcal::edge_profile_test {
namespace {

// The share of light by brute force: a lattice in the pixel and in the disc, all directions.
double Reference(double inside_px, double gaussian_px, double disc_px) {
  constexpr int kPixel = 24, kDirections = 24, kDisc = 21;
  double sum = 0, count = 0;
  for (int d = 0; d < kDirections; ++d) {
    const double angle = 0.5 * std::numbers::pi * (d + 0.5) / kDirections;
    for (int i = 0; i < kPixel; ++i) {
      for (int j = 0; j < kPixel; ++j) {
        const double x = (i + 0.5) / kPixel - 0.5, y = (j + 0.5) / kPixel - 0.5;
        const double at = inside_px + x * std::cos(angle) + y * std::sin(angle);
        for (int u = 0; u < kDisc; ++u) {
          const double across = 2 * (u + 0.5) / kDisc - 1;
          const double weight = std::sqrt(1 - across * across);
          const double t = at + disc_px * across;
          const double share = gaussian_px > 0
                                   ? 0.5 * std::erfc(-t / (gaussian_px * std::numbers::sqrt2))
                                   : (t > 0 ? 1.0 : 0.0);
          sum += weight * share;
          count += weight;
        }
      }
    }
  }
  return sum / count;
}

TEST(EdgeProfile, IsTheBlurredStep) {
  struct Case {
    double gaussian_px, disc_px;
  };
  for (const Case& c : {Case{0, 0}, Case{0.6, 0}, Case{2, 0}, Case{0, 3}, Case{1, 1.5}}) {
    const EdgeProfile profile(c.gaussian_px, c.disc_px);
    for (const double inside_px : {-3.2, -1.0, -0.45, -0.1, 0.0, 0.2, 0.7, 1.9}) {
      EXPECT_NEAR(static_cast<double>(profile.At(static_cast<float>(inside_px))),
                  Reference(inside_px, c.gaussian_px, c.disc_px), 4e-3)
          << inside_px << " px inside, Gaussian " << c.gaussian_px << ", disc " << c.disc_px;
    }
  }
}

TEST(EdgeProfile, GrowsFromZeroToOneAndIsSymmetric) {
  for (const double sigma : {0.0, 0.01, 0.6, 5.0}) {
    const EdgeProfile profile(sigma, sigma / 2);
    float before = 0;
    for (float d = -profile.reach_px() - 1; d < profile.reach_px() + 1; d += 0.03f) {
      EXPECT_GE(profile.At(d), before - 1e-6f);
      EXPECT_NEAR(profile.At(d) + profile.At(-d), 1, 2e-5);
      before = profile.At(d);
    }
    EXPECT_EQ(profile.At(-profile.reach_px() - 0.1f), 0);
    EXPECT_EQ(profile.At(profile.reach_px() + 0.1f), 1);
  }
}

TEST(EdgeProfile, NoDistanceIsDark) { EXPECT_EQ(EdgeProfile(1, 0).At(NAN), 0); }

}  // namespace
}  // namespace rigcal::edge_profile_test
