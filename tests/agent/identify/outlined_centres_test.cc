// SPDX-License-Identifier: Apache-2.0
#include "agent/identify/outlined_centres.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "agent/identify/outline_sectors.h"
#include "agent/identify/wand_stick.h"

namespace rigcal::agent::outlined_centres_test {
namespace {

constexpr double kNoise = 0.02, kRadius = 8;

// A disc of which what is left of `from_x` is hidden; `wide`: its width over its height.
OutlinePixels Disc(const Eigen::Vector2d& centre, double from_x, uint32_t seed, double wide = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, kNoise);
  OutlinePixels pixels;
  const auto middle_x = static_cast<int>(centre.x()), middle_y = static_cast<int>(centre.y());
  for (int y = middle_y - 12; y <= middle_y + 12; ++y) {
    for (int x = middle_x - 12; x <= middle_x + 12; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - centre;
      const double from_middle = std::hypot(d.x() / wide, d.y());
      const double cover = 0.5 * std::erfc((from_middle - kRadius) / (0.7 * std::sqrt(2.0)));
      const double seen = 0.5 * std::erfc((from_x - d.x()) / (0.7 * std::sqrt(2.0)));
      pixels.Add(static_cast<float>(x), static_cast<float>(y),
                 static_cast<float>(cover * seen + noise(random)), static_cast<float>(1 / kNoise));
    }
  }
  pixels.FillUp();
  return pixels;
}

// A wand of three equal spheres, all of them whole by their centroids.
class ThreeSpheres {
 public:
  // `hidden_from_px`: of the last one.
  explicit ThreeSpheres(double hidden_from_px) {
    wand_.diameter_m = 2 * kRadius / 400;
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d centre(40.0 + 60 * static_cast<double>(k), 50.3);
      pixels_[k] = Disc(centre, k == 2 ? hidden_from_px : -100, static_cast<uint32_t>(k + 1));
      outlines_[k].centre_px = centre;
      outlines_[k].radius_px = kRadius;
      MarkerCentre measured;
      measured.centre_px = centre;
      measured.radius_px = kRadius;
      measured.second_moment_px2 = 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity();
      fitted_ = fitted_ && fitter_.Fit(pixels_[k], measured.second_moment_px2, {}, &outlines_[k]);
      wand_.centres.push_back(measured);
      wand_.whole.push_back(true);
      wand_.blobs.push_back(static_cast<int>(k));
      wand_.px_per_m.push_back(400);
    }
  }

  void SetCentres() {
    OutlinedMarkers markers;
    for (size_t k = 0; k < 3; ++k) markers.push_back({&outlines_[k], &pixels_[k]});
    SetOutlinedCentres(markers, &fitter_, &wand_);
  }

  void Squeeze(size_t k, double wide) {
    const Eigen::Vector2d centre = wand_.centres[k].centre_px;
    pixels_[k] = Disc(centre, -100, 7, wide);
    outlines_[k] = SphereOutline();
    outlines_[k].centre_px = centre;
    outlines_[k].radius_px = kRadius;
    fitted_ =
        fitted_ && fitter_.Fit(pixels_[k], wand_.centres[k].second_moment_px2, {}, &outlines_[k]);
  }

  bool fitted_ = true;
  std::array<OutlinePixels, 3> pixels_;
  std::array<SphereOutline, 3> outlines_;
  SphereOutlineFitter fitter_;
  VerifiedWand wand_;
};

// How its light differs from side to side is not seen, and moves the edge by a part of its width.
TEST(SetOutlinedCentres, ClippedLightHasALargerCovariance) {
  ThreeSpheres plain(-100), clipped(-100);
  clipped.pixels_[1].clipped = true;
  plain.SetCentres();
  clipped.SetCentres();
  for (size_t k = 0; k < 3; ++k) {
    const MarkerCentre &with = clipped.wand_.centres[k], &without = plain.wand_.centres[k];
    EXPECT_NEAR(with.covariance_px2(0, 0) - without.covariance_px2(0, 0), k == 1 ? 0.003 : 0,
                k == 1 ? 0.001 : 1e-9);
  }
}

// What hides a side of a sphere leaves an outline that fits well and is in another place. Blur
// and perspective make all of them longer.
TEST(SetOutlinedCentres, AnOutlineThatIsLongerThanTheOthersHasALargerCovariance) {
  ThreeSpheres round(-100), one(-100), less(-100), all(-100);
  one.Squeeze(1, 0.8);
  less.Squeeze(1, 0.9);
  for (size_t k = 0; k < 3; ++k) all.Squeeze(k, 0.8);
  ASSERT_TRUE(one.fitted_);
  ASSERT_TRUE(all.fitted_);
  for (ThreeSpheres* wand : {&round, &one, &less, &all}) wand->SetCentres();
  ASSERT_EQ(all.wand_.OccludedCount(), 0);
  // A fifth of the width is missing on either side: too much to be delivered.
  EXPECT_FALSE(one.wand_.whole[1]);
  EXPECT_GT(less.wand_.centres[1].covariance_px2(0, 0),
            4 * round.wand_.centres[1].covariance_px2(0, 0));
  EXPECT_LT(std::sqrt(less.wand_.centres[0].covariance_px2(0, 0)),
            2 * std::sqrt(round.wand_.centres[0].covariance_px2(0, 0)));
  EXPECT_LT(std::sqrt(all.wand_.centres[1].covariance_px2(0, 0)), 0.2);
}

// A textured background counts as noise around a sphere, not in it, and is behind half of its edge.
TEST(SetOutlinedCentres, OfTheNoiseAroundTheSpheresHalfAtLeastIsTheirs) {
  ThreeSpheres usual(-100), textured(-100);
  for (OutlinePixels& pixels : textured.pixels_) {
    for (float& precision : pixels.precision) precision *= 0.5f;
  }
  for (SphereOutline& outline : textured.outlines_) outline.pixel_noise *= 0.25;
  usual.SetCentres();
  textured.SetCentres();
  const double ratio = textured.wand_.centres[1].covariance_px2.trace() /
                       usual.wand_.centres[1].covariance_px2.trace();
  EXPECT_GT(ratio, 1.6);
  EXPECT_LT(ratio, 2.6);
}

// By their outlines, which move a little along the line between them.
TEST(SetOutlinedCentres, SpheresThatNearlyTouchHaveALargerCovarianceAlongTheWand) {
  ThreeSpheres apart(-100), near(-100);
  // The middle one is said to be there only.
  near.wand_.centres[1].centre_px = near.wand_.centres[0].centre_px + Eigen::Vector2d(17.5, 0);
  apart.SetCentres();
  near.SetCentres();
  const MarkerCentre &one = near.wand_.centres[0], &other = apart.wand_.centres[0];
  EXPECT_LT((one.centre_px - other.centre_px).norm(), 0.01);
  EXPECT_GT(one.covariance_px2(0, 0), other.covariance_px2(0, 0) + 0.002);
  EXPECT_LT(one.covariance_px2(1, 1), 1.5 * other.covariance_px2(1, 1));
  ThreeSpheres overlapping(-100);
  overlapping.wand_.centres[1].centre_px =
      overlapping.wand_.centres[0].centre_px + Eigen::Vector2d(4, 0);
  overlapping.SetCentres();
  EXPECT_FALSE(overlapping.wand_.whole[0]);
}

TEST(SetOutlinedCentres, WithoutOutlinesWhatHidesOneMarkerMayHideTheOthers) {
  const auto sigma_px = [](bool third_is_whole) {
    ThreeSpheres wand(-100);
    wand.wand_.whole[2] = third_is_whole;
    const OutlinedMarkers markers(3, {nullptr, nullptr});
    SetOutlinedCentres(markers, &wand.fitter_, &wand.wand_);
    return std::sqrt(wand.wand_.centres[0].covariance_px2(0, 0));
  };
  EXPECT_GT(sigma_px(false), sigma_px(true) + 0.5);
}

TEST(SetOutlinedCentres, WhatIsBesideASphereWidensItsCovariance) {
  ThreeSpheres alone(-100), beside(-100);
  ASSERT_TRUE(alone.fitted_);
  // Its background is not the same everywhere: one sigma of 0.22 * 0.2 widths of the edge, which
  // has one of 0.7 px, for each of eight independent edges.
  for (MarkerCentre& centre : beside.wand_.centres) centre.background_steps = 0.2;
  alone.SetCentres();
  beside.SetCentres();
  const double widened_px2 = beside.wand_.centres[0].covariance_px2.trace() -
                             alone.wand_.centres[0].covariance_px2.trace();
  EXPECT_NEAR(std::sqrt(0.5 * widened_px2), 0.22 * 0.2 * 0.7 / std::sqrt(8), 0.002);
}

// Lit by the spheres, dark or of the background's colour: a stick tells nothing, but of an arc.
TEST(OutlineSectors, TheSticksSidesAreLeftOutButOfAnArc) {
  SphereOutline outline{.radius_px = kRadius};
  outline.sector_information.fill(400);
  const OutlinePixels pixels = Disc({0, 0}, -100, 1);
  const SectorVariances extra =
      ExtraVariances(pixels, outline, ScatterOfEdges({&outline, nullptr})[0]);
  // By noise alone a sector has 0.0025 px^2.
  EXPECT_LT(extra[0], 0.0025);
  EXPECT_GT(extra[kOutlineSectors], 1000);
  EXPECT_GT(extra[kOutlineSectors + 1], 1000);
  const SectorVariances of_arc =
      ExtraVariances(pixels, outline, ScatterOfEdges({&outline, nullptr})[0], true);
  EXPECT_GT(of_arc[kOutlineSectors], 0.03);
  EXPECT_LT(of_arc[kOutlineSectors], 1);
}

TEST(OutlineSectors, FewSectorsDoNotMakeTheNoiseLess) {
  SphereOutline outline{.radius_px = kRadius};
  outline.sector_information.fill(400);
  outline.pixel_noise = 0.9;
  EXPECT_GT(ScatterOfEdges({&outline})[0].noise, 0.5);
  outline.pixel_noise = 0.1;
  EXPECT_LT(ScatterOfEdges({&outline})[0].noise, 0.35);
}

TEST(MarkStick, MarksABandAlongTheWandBesideTheSphere) {
  ThreeSpheres three(-100);
  OutlinePixels pixels = three.pixels_[1];
  MarkStick(three.wand_, 1, three.outlines_[1], &pixels);
  const Eigen::Vector2d along =
      (three.wand_.centres[2].centre_px - three.wand_.centres[0].centre_px).normalized();
  std::array<int, 3> count{};
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector2d d(static_cast<double>(pixels.x[i]) - three.outlines_[1].centre_px.x(),
                            static_cast<double>(pixels.y[i]) - three.outlines_[1].centre_px.y());
    const uint8_t side = pixels.stick_side[i];
    ++count[side];
    if (side == 0) continue;
    EXPECT_EQ(side == 2, d.dot(along) > 0);
    EXPECT_GT(d.norm(), 0.7 * kRadius);
    EXPECT_LT(std::abs(d.x() * along.y() - d.y() * along.x()), 0.25 * kRadius + 1.1);
  }
  EXPECT_GT(count[1], 5);
  EXPECT_GT(count[2], 5);
  EXPECT_GT(count[0], 5 * (count[1] + count[2]));
}

// A stick that the spheres light, on one side of each, moves the fit of an outline that knows
// nothing of it.
void ExpectAStickDoesNotMoveASphere(double brightness, double least_alone_px) {
  ThreeSpheres without(-100), with(-100);
  for (size_t k = 0; k < 3; ++k) {
    OutlinePixels& pixels = with.pixels_[k];
    const Eigen::Vector2d centre = with.outlines_[k].centre_px;
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double ahead = static_cast<double>(pixels.x[i]) - centre.x();
      const double across = static_cast<double>(pixels.y[i]) - centre.y();
      const double outside = std::clamp(std::hypot(ahead, across) - kRadius + 0.5, 0.0, 1.0);
      if (ahead > 0 && std::abs(across) < 0.2 * kRadius) {
        pixels.coverage[i] += static_cast<float>(brightness * outside);
      }
    }
    ASSERT_TRUE(with.fitter_.Fit(pixels, 0.25 * kRadius * kRadius * Eigen::Matrix2d::Identity(), {},
                                 &with.outlines_[k]));
  }
  without.SetCentres();
  with.SetCentres();
  for (size_t k = 0; k < 3; ++k) {
    const MarkerCentre& moved = with.wand_.centres[k];
    const Eigen::Vector2d error = moved.centre_px - without.wand_.centres[k].centre_px;
    const Eigen::Vector2d alone = with.outlines_[k].centre_px - without.outlines_[k].centre_px;
    EXPECT_GT(alone.norm(), least_alone_px) << k;
    EXPECT_LT(error.norm(), 0.006) << k;
    EXPECT_LT(moved.covariance_px2(1, 1), moved.covariance_px2(0, 0)) << k;
  }
}

TEST(SetOutlinedCentres, AStickDoesNotMoveASphere) {
  ExpectAStickDoesNotMoveASphere(0.06, 0.0075);
  // The robust weights leave out a bright one.
  ExpectAStickDoesNotMoveASphere(0.35, 0);
}

TEST(OutlineSectors, OneThatIsFarAwayAndOneBeforeASaturatedBackgroundCountLess) {
  SphereOutline outline{.radius_px = kRadius};
  outline.sector_information.fill(400);  // 0.05 px each
  for (size_t s = 0; s < kOutlineSectors; ++s) outline.sector_score[s] = s % 2 == 0 ? 14 : -14;
  outline.sector_score[3] = 0.6 * 400;
  OutlinePixels pixels = Disc({0, 0}, -100, 1);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t s =
        OutlineSector(static_cast<double>(pixels.x[i]), static_cast<double>(pixels.y[i]));
    pixels.saturated_behind[i] = s == 8 ? 1 : 0;
  }
  const EdgeScatter scatter = ScatterOfEdges({&outline})[0];
  const SectorVariances extra = ExtraVariances(pixels, outline, scatter);
  EXPECT_GT(extra[3], 0.3);
  EXPECT_GT(extra[8], 0.08);
  EXPECT_LT(extra[5], 0.05);
  OutlinePixels discounted;
  Discount(pixels, outline, extra, scatter.noise, &discounted);
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t s =
        OutlineSector(static_cast<double>(pixels.x[i]), static_cast<double>(pixels.y[i]));
    if (s == 3) {
      EXPECT_LE(discounted.precision[i], 0.15f * pixels.precision[i]);
    } else if (s == 8) {
      EXPECT_LE(discounted.precision[i], 0.19f * pixels.precision[i]);
    } else if (s == 5) {
      EXPECT_GE(discounted.precision[i], 0.2f * pixels.precision[i]);
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::outlined_centres_test
