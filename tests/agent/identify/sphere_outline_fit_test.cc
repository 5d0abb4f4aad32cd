// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/sphere_outline_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace rigcal::agent::sphere_outline_fit_test {
namespace {

constexpr double kNoise = 0.02;

// A disc whose light grows by `slope` from its middle to its right edge, blurred.
OutlinePixels Disc(const Eigen::Vector2d& centre, double radius, double slope, uint32_t seed,
                   double sigma = kNoise) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, sigma);
  OutlinePixels pixels;
  const int reach = static_cast<int>(radius) + 4;
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - centre;
      const double cover = 0.5 * std::erfc((d.norm() - radius) / (0.7 * std::sqrt(2.0)));
      const double light = 1 + slope * d.x() / std::max(radius, d.norm());
      pixels.Add(static_cast<float>(x), static_cast<float>(y),
                 static_cast<float>(cover * light + noise(random)), static_cast<float>(1 / sigma));
    }
  }
  pixels.FillUp();
  return pixels;
}

Eigen::Vector2d Centroid(const OutlinePixels& pixels) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double all = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (!(pixels.precision[i] > 0)) continue;
    const auto c = static_cast<double>(pixels.coverage[i]);
    sum += c * Eigen::Vector2d(static_cast<double>(pixels.x[i]), static_cast<double>(pixels.y[i]));
    all += c;
  }
  return sum / all;
}

TEST(SphereOutlineFitter, LightFromOneSideDoesNotMoveTheCentre) {
  SphereOutlineFitter fitter;
  for (const double radius : {4.0, 9.0, 14.0}) {
    const Eigen::Vector2d centre(0.31, -0.22);
    const OutlinePixels pixels = Disc(centre, radius, 0.4, 5);
    EXPECT_GT((Centroid(pixels) - centre).norm(), 0.05 * radius);
    SphereOutline outline{.centre_px = Centroid(pixels), .radius_px = 1.05 * radius};
    ASSERT_TRUE(
        fitter.Fit(pixels, 0.25 * radius * radius * Eigen::Matrix2d::Identity(), {}, &outline));
    // Four sigmas of the noise, and what the model of the edge leaves.
    EXPECT_LT((outline.centre_px - centre).norm(),
              4 * std::sqrt(outline.covariance_px2.trace()) + 0.02)
        << radius;
    EXPECT_LT((outline.centre_px - centre).norm(), 0.12) << radius;
    EXPECT_NEAR(outline.radius_px, radius, 0.15);
    EXPECT_GT(outline.slope_chi_squared, 50);
  }
}

// A thick stick in front of a sphere takes away so much that the centroid of what is left is a
// tenth of the radius off. Some of these fits do not settle from there.
TEST(SphereOutlineFitter, AStickInFrontDoesNotMoveTheCentre) {
  SphereOutlineFitter fitter;
  for (double radius = 8; radius < 17; ++radius) {
    const Eigen::Vector2d centre(0.31, -0.22);
    OutlinePixels pixels = Disc(centre, radius, 0, 5);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double x = static_cast<double>(pixels.x[i]) - centre.x();
      const double y = static_cast<double>(pixels.y[i]) - centre.y();
      // From the upper left to the middle.
      if (std::abs(x - y) < 0.5 * radius && x + y < 0) pixels.coverage[i] = 0;
      pixels.precision[i] *= 2;
    }
    const Eigen::Vector2d begin = Centroid(pixels);
    EXPECT_GT((begin - centre).norm(), 0.1 * radius);
    SphereOutline outline{.centre_px = begin, .radius_px = 0.93 * radius};
    ASSERT_TRUE(
        fitter.Fit(pixels, 0.23 * radius * radius * Eigen::Matrix2d::Identity(), {}, &outline))
        << radius;
    EXPECT_LT((outline.centre_px - centre).norm(), 0.15) << radius;
    EXPECT_NEAR(outline.radius_px, radius, 0.15);
  }
}

// Lambert's law, from above and a little from behind, where a polynomial is 0.1 px off.
TEST(SphereOutlineFitter, WhiteLightFromAboveDoesNotMoveTheCentre) {
  SphereOutlineFitter fitter;
  for (const double radius : {5.0, 8.0, 12.0}) {
    OutlinePixels pixels = Disc({0.2, 0.1}, radius, 0, 3);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const Eigen::Vector2d d(static_cast<double>(pixels.x[i]) - 0.2,
                              static_cast<double>(pixels.y[i]) - 0.1);
      const Eigen::Vector2d u = d / std::max(radius, d.norm());
      const double facing = std::sqrt(std::max(0.0, 1 - u.squaredNorm()));
      const double cover = 0.5 * std::erfc((d.norm() - radius) / (0.7 * std::sqrt(2.0)));
      pixels.coverage[i] += static_cast<float>(cover * std::max(0.0, -0.5 * u.y() - 0.2 * facing));
    }
    SphereOutline plain{.centre_px = {0.3, -0.2}, .radius_px = 1.03 * radius};
    const Eigen::Matrix2d shape = 0.25 * radius * radius * Eigen::Matrix2d::Identity();
    ASSERT_TRUE(fitter.Fit(pixels, shape, {}, &plain));
    SphereOutline white = plain;
    ASSERT_TRUE(fitter.Fit(pixels, shape, {.white = true}, &white));
    EXPECT_LT(white.cost, plain.cost) << radius;
    EXPECT_LT((white.centre_px - Eigen::Vector2d(0.2, 0.1)).norm(), 0.05) << radius;
  }
}

// A disc before a window that is four times as bright as what saturates, to the right of `from`.
OutlinePixels BeforeAWindow(const Eigen::Vector2d& centre, double radius, double from, bool known) {
  constexpr double kSphere = 0.8, kWindow = 4;  // of what saturates
  OutlinePixels pixels = Disc(centre, radius, 0, 3);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const auto x = static_cast<double>(pixels.x[i]), y = static_cast<double>(pixels.y[i]);
    if (x < from) continue;
    const double away = (Eigen::Vector2d(x, y) - centre).norm() - radius;
    const double cover = 0.5 * std::erfc(away / (0.7 * std::sqrt(2.0)));
    const double grey = std::min(1.0, cover * kSphere + (1 - cover) * kWindow);
    pixels.coverage[i] = static_cast<float>((1 - grey) / (1 - kSphere));
    pixels.saturated_behind[i] = known ? 1 : 0;
  }
  return pixels;
}

TEST(SphereOutlineFitter, ASaturatedBackgroundDoesNotMoveTheCentre) {
  SphereOutlineFitter fitter;
  const Eigen::Vector2d centre(0.2, 0.1);
  for (const double radius : {6.0, 9.0, 14.0}) {
    const Eigen::Matrix2d shape = 0.25 * radius * radius * Eigen::Matrix2d::Identity();
    for (const double from : {-100.0, -0.3 * radius, 0.0, 0.3 * radius}) {
      SphereOutline outline{.centre_px = {0, -0.2}, .radius_px = 0.95 * radius};
      ASSERT_TRUE(fitter.Fit(BeforeAWindow(centre, radius, from, true), shape, {}, &outline));
      EXPECT_LT((outline.centre_px - centre).norm(), 0.1) << radius << " " << from;
      // All around, its own edge says little of the radius.
      EXPECT_NEAR(outline.radius_px, radius, from < -radius ? 1 : 0.15) << from;
    }
    // That it looks smaller there moves its centre, where that is not known.
    SphereOutline moved{.centre_px = {0, -0.2}, .radius_px = 0.95 * radius};
    ASSERT_TRUE(fitter.Fit(BeforeAWindow(centre, radius, 0, false), shape, {}, &moved));
    EXPECT_GT((moved.centre_px - centre).norm(), 0.25) << radius;
  }
}

// Behind a mosaic each channel's coverage is 1 where the sphere was measured, white light included,
// of which the channels have different shares. Its own light is uneven across the white light.
TEST(SphereOutlineFitter, WhiteLightThroughAMosaicDoesNotMoveTheCentre) {
  SphereOutlineFitter fitter;
  for (const double radius : {6.0, 12.0}) {
    const Eigen::Vector2d centre(0.2, 0.1);
    OutlinePixels pixels = Disc(centre, radius, 0, 3);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const float shares[] = {1.0f, 1.6f, 1.6f, 4.0f};
      const float share = shares[i % 2 + 2 * (static_cast<size_t>(pixels.y[i] + 64) % 2)];
      const Eigen::Vector2d d(static_cast<double>(pixels.x[i]) - centre.x(),
                              static_cast<double>(pixels.y[i]) - centre.y());
      const Eigen::Vector2d u = d / std::max(radius, d.norm());
      const double facing = std::sqrt(std::max(0.0, 1 - u.squaredNorm()));
      const double cover = 0.5 * std::erfc((d.norm() - radius) / (0.7 * std::sqrt(2.0)));
      const double toward = -0.3 * u.y() + 0.06 * facing;
      const double lit = std::max(0.0, toward) + 0.3 * toward;
      constexpr double kInCore = 0.1;  // of `lit`, where the sphere is measured
      pixels.white[i] = share;
      pixels.coverage[i] = static_cast<float>(
          cover * (1 + 0.15 * u.x() + static_cast<double>(share) * (lit - kInCore)));
    }
    const Eigen::Matrix2d shape = 0.25 * radius * radius * Eigen::Matrix2d::Identity();
    SphereOutline plain{.centre_px = {0.3, -0.2}, .radius_px = 1.03 * radius};
    ASSERT_TRUE(fitter.Fit(pixels, shape, {}, &plain));
    SphereOutline white = plain;
    ASSERT_TRUE(fitter.Fit(pixels, shape, {.white = true}, &white));
    EXPECT_LT(white.cost, plain.cost) << radius;
    EXPECT_LT((white.centre_px - centre).norm(), 0.025) << radius;
    EXPECT_NEAR(white.own_slope.x(), 0.15, 0.05) << radius;
  }
}

// Blur mixes the light near the rim with what is further inside.
TEST(SphereOutlineFitter, BlurOfAnUnevenSphereDoesNotMoveTheCentre) {
  constexpr double kRadius = 4, kBlurPx = 1.2, kSlope = 0.35, kStep = 0.2;
  const Eigen::Vector2d centre(0.2, -0.1);
  OutlinePixels pixels;
  for (int y = -10; y <= 10; ++y) {
    for (int x = -10; x <= 10; ++x) {
      double light = 0;
      for (double v = -kRadius; v < kRadius; v += kStep) {
        for (double u = -kRadius; u < kRadius; u += kStep) {
          if (u * u + v * v > kRadius * kRadius) continue;
          const double squared =
              (Eigen::Vector2d(x, y) - centre - Eigen::Vector2d(u, v)).squaredNorm();
          light += (1 + kSlope * u / kRadius) * std::exp(-0.5 * squared / (kBlurPx * kBlurPx));
        }
      }
      light *= kStep * kStep / (2 * std::numbers::pi * kBlurPx * kBlurPx);
      pixels.Add(static_cast<float>(x), static_cast<float>(y), static_cast<float>(light), 50);
    }
  }
  pixels.FillUp();
  SphereOutlineFitter fitter;
  SphereOutline outline{.centre_px = Centroid(pixels), .radius_px = kRadius};
  ASSERT_TRUE(
      fitter.Fit(pixels, 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity(), {}, &outline));
  EXPECT_LT((outline.centre_px - centre).norm(), 0.05);
}

TEST(SphereOutlineFitter, CovarianceIsThatOfTheErrors) {
  SphereOutlineFitter fitter;
  double nees = 0;
  constexpr int kRuns = 200;
  for (uint32_t seed = 1; seed <= kRuns; ++seed) {
    const Eigen::Vector2d centre(0.001 * seed, 0.4 - 0.003 * seed);
    const OutlinePixels pixels = Disc(centre, 8, 0, seed);
    SphereOutline outline{.centre_px = Eigen::Vector2d(0.1, 0.1), .radius_px = 8.3};
    ASSERT_TRUE(
        fitter.Fit(pixels, 16 * Eigen::Matrix2d::Identity(), {.slope_sigma = 1e-3}, &outline))
        << seed;
    const Eigen::Vector2d error = outline.centre_px - centre;
    nees += error.dot(outline.covariance_px2.inverse() * error) / (2 * kRuns);
  }
  // 400 degrees of freedom: 0.8 to 1.2 in all but 1 of 200 cases.
  EXPECT_GT(nees, 0.75);
  EXPECT_LT(nees, 1.3);
}

TEST(SphereOutlineFitter, RefusesNothingAndHalfADisc) {
  SphereOutlineFitter fitter;
  OutlinePixels pixels;
  SphereOutline outline{.radius_px = 8};
  EXPECT_FALSE(fitter.Fit(pixels, 16 * Eigen::Matrix2d::Identity(), {}, &outline));
  pixels = Disc({0, 0}, 8, 0, 1);
  const double whole = [&] {
    SphereOutline fit{.radius_px = 8};
    EXPECT_TRUE(fitter.Fit(pixels, 16 * Eigen::Matrix2d::Identity(), {}, &fit));
    return fit.residual;
  }();
  for (size_t i = 0; i < pixels.size(); ++i) {
    if (pixels.x[i] > 1) pixels.coverage[i] = 0;
  }
  outline = {.radius_px = 8};
  // Either it does not converge, or it says that it does not fit.
  if (fitter.Fit(pixels, 16 * Eigen::Matrix2d::Identity(), {}, &outline)) {
    EXPECT_GT(outline.residual, 2 * whole);
  }
}

TEST(OutlineRows, SectorsAreEvenlyWide) {
  for (int i = 0; i < 1600; ++i) {
    const double turn = (i + 0.5) / 1600;
    const double angle = 2 * std::numbers::pi * (turn - 0.5);
    ASSERT_EQ(OutlineSector(3 * std::cos(angle), 3 * std::sin(angle)),
              static_cast<size_t>(turn * kOutlineSectors))
        << i;
  }
}

// A disc with a saturated background on one side.
OutlinePixels Outshone(double radius) {
  OutlinePixels pixels = Disc({0, 0}, radius, 0, 1);
  for (size_t i = 0; i < pixels.size(); ++i) pixels.saturated_behind[i] = pixels.x[i] > 0 ? 1 : 0;
  return pixels;
}

void ExpectSlopesOfTheModel(bool white_light) {
  OutlinePixels pixels = Outshone(5);
  for (size_t i = 0; i < pixels.size(); i += 2) pixels.white[i] = 2.5f;
  std::array<float, kOutlineCount> parameters = {0.2f,  -0.3f, 4.3f, 0.01f,  -0.01f, 0.6f,
                                                 0.1f,  -0.1f, 1.0f, 0.2f,   -0.1f,  0.1f,
                                                 0.05f, -0.2f, 0.1f, -0.15f, 0.2f,   0.1f};
  OutlineRows rows, above, below;
  rows.Model(pixels, parameters.data(), white_light);
  for (int p = 0; p < kOutlineCount; ++p) {
    // Have no meaning there.
    if (!white_light && p >= kOutlineOwnX && p <= kOutlineSky) continue;
    const float step = white_light ? 0.001f : 0.01f;  // less across the end of the light
    const float value = parameters[static_cast<size_t>(p)];
    parameters[static_cast<size_t>(p)] = value + step;
    above.Model(pixels, parameters.data(), white_light);
    parameters[static_cast<size_t>(p)] = value - step;
    below.Model(pixels, parameters.data(), white_light);
    parameters[static_cast<size_t>(p)] = value;
    double error = 0, all = 0;
    for (size_t i = 0; i < pixels.size(); ++i) {
      const float slope = (above.value(i) - below.value(i)) / (2 * step);
      error +=
          std::pow(static_cast<double>(slope - rows.slope(static_cast<OutlineParameter>(p), i)), 2);
      all += std::pow(static_cast<double>(slope), 2);
    }
    // How the outline's normal turns is left out of the slopes.
    EXPECT_LT(std::sqrt(error / all), 0.05) << p;
  }
}

TEST(OutlineRows, TheEdgeAloneIsTheSame) {
  const OutlinePixels pixels = Outshone(5);
  std::array<float, kOutlineCount> parameters = {0.2f,  -0.3f, 4.3f, 0.01f, -0.01f, 0.6f,
                                                 0.1f,  -0.1f, 1.0f, 0.2f,  -0.1f,  0.1f,
                                                 0.05f, -0.2f, 0.1f, 0.2f,  0.2f,   0.3f};
  for (const bool white_light : {false, true}) {
    OutlineRows all, edge;
    all.Model(pixels, parameters.data(), white_light);
    edge.ModelEdge(pixels, parameters.data(), white_light);
    for (size_t i = 0; i < pixels.size(); ++i) {
      ASSERT_EQ(all.value(i), edge.value(i));
      ASSERT_EQ(all.slope(kOutlineRadius, i), edge.slope(kOutlineRadius, i));
    }
  }
}

TEST(OutlineRows, SumsAllProducts) {
  OutlinePixels pixels = Disc({0, 0}, 9, 0, 1);
  std::array<float, kOutlineCount> parameters = {0.2f,  -0.3f, 8.3f, 0.01f, -0.01f, 0.6f,
                                                 0.1f,  -0.1f, 1.0f, 0.2f,  -0.1f,  0.1f,
                                                 0.05f, -0.2f, 0.1f, 0.2f,  0.2f,   0.3f};
  std::vector<float> weight, residual;
  for (size_t i = 0; i < pixels.size(); ++i) {
    weight.push_back(0.1f * static_cast<float>(i % 11));
    residual.push_back(0.01f * static_cast<float>(i % 17) - 0.08f);
  }
  for (const auto& [white_light, outshone] :
       {std::pair(false, false), std::pair(true, false), std::pair(false, true)}) {
    OutlineRows rows;
    if (outshone) pixels = Outshone(9);
    rows.Model(pixels, parameters.data(), white_light);
    std::array<float, kOutlineCount * kOutlineCount> products{};
    std::array<float, kOutlineCount> gradient{};
    rows.Sum(weight, residual, products.data(), gradient.data());
    const auto sum = [&](int i, const auto& other) {
      double total = 0, size = 0;
      for (size_t k = 0; k < pixels.size(); ++k) {
        const double one =
            static_cast<double>(weight[k] * rows.slope(static_cast<OutlineParameter>(i), k)) *
            static_cast<double>(other(k));
        total += one;
        size += std::abs(one);
      }
      return std::pair(total, 1e-5 * size + 1e-9);
    };
    for (int i = 0; i < (white_light || outshone ? kOutlineCount : kOutlineOwnX); ++i) {
      const auto [total, error] = sum(i, [&](size_t k) { return residual[k]; });
      ASSERT_NEAR(static_cast<double>(gradient[static_cast<size_t>(i)]), total, error) << i;
      for (int j = 0; j <= i; ++j) {
        const auto [product, its_error] =
            sum(i, [&](size_t k) { return rows.slope(static_cast<OutlineParameter>(j), k); });
        ASSERT_NEAR(static_cast<double>(products[static_cast<size_t>(i * kOutlineCount + j)]),
                    product, its_error)
            << i << " " << j;
      }
    }
  }
}

TEST(OutlineRows, SlopesAreThoseOfTheModel) {
  ExpectSlopesOfTheModel(false);
  ExpectSlopesOfTheModel(true);
}

}  // namespace
}  // namespace rigcal::agent::sphere_outline_fit_test
