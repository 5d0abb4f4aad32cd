// SPDX-License-Identifier: Apache-2.0
#include "server/solve/geometry/relative_pose.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace rigcal::server::relative_pose_test {
namespace {

constexpr double kFocalPx = 1000;

RelativePoseOptions Options() {
  RelativePoseOptions options;
  options.marker_positions_m = {0, 0.13, 0.39};
  options.focal_a_px = options.focal_b_px = kFocalPx;
  return options;
}

// Camera b stands 2 m to the right and looks back in.
RigidTransform SideBySide() {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.45, Eigen::Vector3d::UnitY()));
  return {rotation, rotation * -Eigen::Vector3d(2, 0.1, 0.3)};
}

struct Waving {
  int instants = 80;
  double noise_px = 0.3;
  double depth_m = 1.0;      // half the range of depths
  double turn = 1;           // of the direction out of the plane z = 4
  double outlier_share = 0;  // of instants, b's views put anywhere
};

std::vector<PairInstant> Wave(const RigidTransform& b_from_a, const Waving& waving,
                              uint32_t seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal(0, waving.noise_px / kFocalPx);
  std::vector<PairInstant> instants;
  while (static_cast<int>(instants.size()) < waving.instants) {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    const Eigen::Vector3d origin(x, 0.8 * y, 4 + waving.depth_m * z);
    const double u = uniform(random), v = uniform(random), w = uniform(random);
    const Eigen::Vector3d direction = Eigen::Vector3d(u, v, waving.turn * w).normalized();
    const bool outlier = uniform(random) < 2 * waving.outlier_share - 1;
    PairInstant pair;
    for (int m = 0; m < 3; ++m) {
      const Eigen::Vector3d x_in_a =
          origin + Options().marker_positions_m[static_cast<size_t>(m)] * direction;
      PairMarker marker{m, x_in_a.hnormalized(), (b_from_a * x_in_a).hnormalized()};
      for (double* value :
           {&marker.ray_a.x(), &marker.ray_a.y(), &marker.ray_b.x(), &marker.ray_b.y()}) {
        *value += normal(random);
      }
      if (outlier) marker.ray_b = {0.5 * uniform(random), 0.5 * uniform(random)};
      pair.push_back(marker);
    }
    instants.push_back(pair);
  }
  return instants;
}

void ExpectNear(const std::optional<RelativePose>& pose, const RigidTransform& truth,
                double position_m, double angle_rad) {
  ASSERT_TRUE(pose.has_value());
  EXPECT_LT(
      (pose->b_from_a.SourceFromTargetTranslation() - truth.SourceFromTargetTranslation()).norm(),
      position_m);
  EXPECT_LT(pose->b_from_a.rotation.angularDistance(truth.rotation), angle_rad);
}

// The first marker alone.
std::vector<PairInstant> PointsOf(std::vector<PairInstant> instants) {
  for (PairInstant& instant : instants) instant.resize(1);
  return instants;
}

RelativePoseOptions PointOptions() {
  RelativePoseOptions options = Options();
  options.marker_positions_m = {0};
  return options;
}

TEST(EstimateRelativePose, OfOneMarkerHasABaselineOfLengthOne) {
  Waving waving;
  waving.instants = 200;
  waving.outlier_share = 0.2;
  const auto pose = EstimateRelativePose(PointsOf(Wave(SideBySide(), waving)), PointOptions());
  RigidTransform truth = SideBySide();
  truth.translation_m.normalize();
  ExpectNear(pose, truth, 0.01, 0.005);
  EXPECT_NEAR(pose->b_from_a.translation_m.norm(), 1, 1e-12);
}

TEST(EstimateRelativePose, OfOneMarkerThatContradictsItselfIsNone) {
  Waving waving;
  waving.outlier_share = 1;
  const auto pose = EstimateRelativePose(PointsOf(Wave(SideBySide(), waving)), PointOptions());
  // Any two rays nearly meet somewhere for some of them.
  if (!pose) return;
  EXPECT_LT(pose->inlier_count, pose->instant_count / 2);
}

TEST(EstimateRelativePose, FindsTheMetricPose) {
  const auto pose = EstimateRelativePose(Wave(SideBySide(), {}), Options());
  ExpectNear(pose, SideBySide(), 0.02, 0.005);
  EXPECT_EQ(pose->instant_count, 80);
  EXPECT_GT(pose->inlier_count, 75);
  EXPECT_LT(pose->median_px, 1);
}

TEST(EstimateRelativePose, ExactViewsGiveTheExactPose) {
  Waving waving;
  waving.noise_px = 0;
  const auto pose = EstimateRelativePose(Wave(SideBySide(), waving), Options());
  ExpectNear(pose, SideBySide(), 1e-4, 1e-5);
  EXPECT_EQ(pose->inlier_count, 80);
}

TEST(EstimateRelativePose, EndsTheSameBitForBit) {
  const std::vector<PairInstant> instants = Wave(SideBySide(), {});
  const auto first = EstimateRelativePose(instants, Options());
  const auto second = EstimateRelativePose(instants, Options());
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->b_from_a.rotation.coeffs(), second->b_from_a.rotation.coeffs());
  EXPECT_EQ(first->b_from_a.translation_m, second->b_from_a.translation_m);
  EXPECT_EQ(first->median_px, second->median_px);
}

// Two planar solutions agree with a plane waved in; the size of the wand tells them apart.
TEST(EstimateRelativePose, FindsThePoseFromAWandKeptInOnePlane) {
  Waving waving;
  waving.depth_m = 0;
  waving.turn = 0;
  for (const uint32_t seed : {1u, 2u, 3u}) {
    ExpectNear(EstimateRelativePose(Wave(SideBySide(), waving, seed), Options()), SideBySide(),
               0.15, 0.05);
  }
}

// Opposite cameras: the mirrored pose has the wand behind them.
// A plane has two poses that agree with it, as long as the wand's direction tells little.
TEST(EstimateRelativePose, GivesTheNextBestPoseWhenAskedForIt) {
  Waving waving;
  waving.depth_m = 0;
  waving.turn = 0;
  const std::vector<PairInstant> instants = Wave(SideBySide(), waving);
  RelativePoseOptions options = Options();
  const auto best = EstimateRelativePose(instants, options);
  options.rank = 1;
  const auto second = EstimateRelativePose(instants, options);
  ASSERT_TRUE(best && second);
  EXPECT_GT(best->b_from_a.rotation.angularDistance(second->b_from_a.rotation), 0.1);
  EXPECT_LE(second->inlier_count, best->inlier_count);
}

TEST(EstimateRelativePose, GivesTheLastPoseWhereThereAreFewer) {
  RelativePoseOptions options = Options();
  options.rank = 5;
  ExpectNear(EstimateRelativePose(Wave(SideBySide(), {}), options), SideBySide(), 0.02, 0.005);
}

TEST(EstimateRelativePose, FindsACameraThatLooksBackAtTheFirst) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(M_PI - 0.2, Eigen::Vector3d::UnitY()));
  const RigidTransform opposite(rotation, rotation * -Eigen::Vector3d(0.5, 0.2, 8));
  ExpectNear(EstimateRelativePose(Wave(opposite, {}), Options()), opposite, 0.05, 0.01);
}

TEST(EstimateRelativePose, KeepsItsPoseAmongOutliers) {
  Waving waving;
  waving.instants = 150;
  waving.outlier_share = 0.4;
  const auto pose = EstimateRelativePose(Wave(SideBySide(), waving), Options());
  ExpectNear(pose, SideBySide(), 0.05, 0.01);
  EXPECT_GT(pose->inlier_count, 70);
  EXPECT_LT(pose->inlier_count, 110);
}

TEST(EstimateRelativePose, CountsOnlyTheInstantsItLooksAt) {
  Waving waving;
  waving.instants = 301;
  const auto pose = EstimateRelativePose(Wave(SideBySide(), waving), Options());
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->instant_count, 200);
  EXPECT_LE(pose->inlier_count, 200);
}

TEST(EstimateRelativePose, HasNoneFromTooFewInstants) {
  EXPECT_FALSE(EstimateRelativePose({}, Options()));
  Waving waving;
  // Five samples are drawn from five different instants: fewer must not be waited for.
  for (const int instants : {1, 4, 7}) {
    waving.instants = instants;
    EXPECT_FALSE(EstimateRelativePose(Wave(SideBySide(), waving), Options())) << instants;
  }
}

TEST(EstimateRelativePose, HasNoneFromViewsThatHaveNothingToDoWithEachOther) {
  Waving waving;
  waving.outlier_share = 1;
  EXPECT_FALSE(EstimateRelativePose(Wave(SideBySide(), waving), Options()));
}

TEST(EstimateRelativePose, HasNoneForATargetOfOneMarker) {
  std::vector<PairInstant> instants = Wave(SideBySide(), {});
  for (PairInstant& instant : instants) instant.resize(1);
  EXPECT_FALSE(EstimateRelativePose(instants, Options()));
}

// Any depth agrees with no baseline, and the wand's size cannot be had.
TEST(EstimateRelativePose, ClaimsNoBaselineBetweenTwoCamerasAtOnePlace) {
  const RigidTransform turned(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY())),
                              Eigen::Vector3d::Zero());
  const auto pose = EstimateRelativePose(Wave(turned, {}), Options());
  ASSERT_TRUE(pose);
  EXPECT_LT(pose->b_from_a.translation_m.norm(), 0.2);
  EXPECT_LT(pose->b_from_a.rotation.angularDistance(turned.rotation), 0.05);
}

TEST(EstimateRelativePose, EndsWhereEveryViewIsTheSame) {
  const PairMarker same{0, {0.1, 0.1}, {0.2, 0.1}};
  PairMarker other = same;
  other.marker = 2;
  EXPECT_FALSE(EstimateRelativePose(std::vector<PairInstant>(30, {same, other}), Options()));
}

// Callers leave such rays out; one that slips through costs the pose, not its truth.
TEST(EstimateRelativePose, HasNoneWhereRaysAreNotFinite) {
  const std::vector<PairInstant> finite = Wave(SideBySide(), {});
  std::vector<PairInstant> instants = finite;
  instants[7][1].ray_b.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(EstimateRelativePose(instants, Options()));
  instants = finite;
  for (PairInstant& instant : instants) {
    for (PairMarker& marker : instant) {
      marker.ray_a.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
  EXPECT_FALSE(EstimateRelativePose(instants, Options()));
}

}  // namespace
}  // namespace rigcal::server::relative_pose_test
