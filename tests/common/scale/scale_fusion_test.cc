// SPDX-License-Identifier: Apache-2.0
#include "common/scale/scale_fusion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/common/triangulate/true_result.h"
#include "tests/testing/status_matchers.h"

namespace rigcal {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::StatusIs;

ScaleSource Source(const char* name, double change, double sigma_rel) {
  return {name, 2 * (1 + change), 2 * sigma_rel, 2, 0, {}};
}

TEST(FuseScales, WeighsSourcesByTheirSigmas) {
  const ScaleFusion fusion = FuseScales({Source("a", 0.001, 0.001), Source("b", 0.0, 0.002)}, {});
  EXPECT_NEAR(fusion.factor, 1.0008, 1e-6);
  EXPECT_NEAR(fusion.sigma_rel, 0.001 * std::sqrt(0.8), 1e-6);
  EXPECT_EQ(fusion.odd, -1);
  EXPECT_FALSE(fusion.undecided);
}

TEST(FuseScales, NamesTheOneOfThreeThatIsOff) {
  for (int odd = 0; odd < 3; ++odd) {
    std::vector<ScaleSource> sources;
    for (int i = 0; i < 3; ++i) sources.push_back(Source("s", i == odd ? 0.03 : 0, 0.002));
    const ScaleFusion fusion = FuseScales(sources, {});
    EXPECT_EQ(fusion.odd, odd);
    const ScaleResidual& residual = fusion.residuals[static_cast<size_t>(odd)];
    EXPECT_NEAR(residual.from_others_rel, 0.03, 1e-9);
    // The given sigma is a smaller share of a longer length.
    const double sigma_rel = 0.002 * std::sqrt(1 / (1.03 * 1.03) + 0.5);
    EXPECT_NEAR(residual.from_others_sigmas, std::log(1.03) / sigma_rel, 1e-3);
  }
}

TEST(FuseScales, OfTwoThatDisagreeNothingSaysWhich) {
  const ScaleFusion fusion = FuseScales({Source("a", 0.03, 0.001), Source("b", 0, 0.001)}, {});
  EXPECT_EQ(fusion.odd, -1);
  EXPECT_TRUE(fusion.undecided);
}

// A third that is known a hundred times worse does not decide.
TEST(FuseScales, AWeakSourceDoesNotDecideBetweenTwo) {
  const ScaleFusion fusion =
      FuseScales({Source("wand", 0, 0.02), Source("a", 0.01, 0.0002), Source("b", 0, 0.0002)}, {});
  EXPECT_EQ(fusion.odd, -1);
  EXPECT_TRUE(fusion.undecided);
  EXPECT_EQ(fusion.suspects[0], 1);
  EXPECT_EQ(fusion.suspects[1], 2);
}

// Two lengths that the same error of the shape makes longer are one source, not two.
TEST(FuseScales, LengthsShareTheErrorsOfTheShape) {
  CameraCovariance covariance;
  covariance.matrix = 1e-4 * Eigen::MatrixXd::Identity(1, 1);
  ScaleSource a = Source("a", 0, 1e-6), b = Source("b", 0, 1e-6);
  a.gain = b.gain = Eigen::RowVectorXd::Ones(1);
  const double one = FuseScales({a}, covariance).sigma_rel;
  const double both = FuseScales({a, b}, covariance).sigma_rel;
  EXPECT_NEAR(one, 0.01 / 2, 1e-6);
  EXPECT_NEAR(both, one, 1e-6);
}

SimulatedWorld World() {
  SimulationOptions simulation;
  simulation.camera_count = 4;
  simulation.duration_s = 6;
  simulation.outlier_share = 0;
  Target wand;
  wand.marker_positions_m = {0, 0.13, 0.39};
  return *SimulatedWorld::Create(simulation, wand);
}

TEST(ScaleOfCameras, HasTheirDistance) {
  const CalibrationResult calibration = testing::TrueResult(World());
  const auto source = ScaleOfCameras(calibration, {}, "sim_0", "sim_1", 4, 0.002);
  ASSERT_THAT(source, IsOk());
  EXPECT_NEAR(source->measured_m,
              (calibration.cameras[0].cam_from_rig.SourceFromTargetTranslation() -
               calibration.cameras[1].cam_from_rig.SourceFromTargetTranslation())
                  .norm(),
              1e-12);
  EXPECT_THAT(ScaleOfCameras(calibration, {}, "sim_0", "left", 4, 0.002),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no camera left")));
}

TEST(ScaleOfMarkers, MeasuresABarWithItsNoise) {
  const SimulatedWorld world = World();
  const CalibrationResult calibration = testing::TrueResult(world);
  const auto triangulation =
      TriangulateRows(calibration, testing::RowsOf(world), {.sigma_px = 0.3});
  ASSERT_THAT(triangulation, IsOk());
  for (const auto& [a, b] : {std::pair(0, 2), std::pair(2, 0)}) {
    const auto source = ScaleOfMarkers(calibration, {}, *triangulation, a, b, 0.39, 0.0002);
    ASSERT_THAT(source, IsOk());
    EXPECT_GT(source->noise_m, 1e-5);
    EXPECT_LT(source->noise_m, 5e-4);
    EXPECT_NEAR(source->measured_m, 0.39, 4 * source->noise_m);
  }
  EXPECT_THAT(ScaleOfMarkers(calibration, {}, *triangulation, 0, 7, 1, 0.001),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("at 0 instants")));
}

TEST(Rescale, MakesEveryLengthLonger) {
  CalibrationResult calibration = testing::TrueResult(World());
  calibration.target.marker_positions_m = {0, 0.13, 0.39};
  const CalibrationResult scaled = Rescale(calibration, 1.01, 0.0003);
  EXPECT_NEAR(scaled.cameras[2].cam_from_rig.SourceFromTargetTranslation().norm(),
              1.01 * calibration.cameras[2].cam_from_rig.SourceFromTargetTranslation().norm(),
              1e-12);
  EXPECT_NEAR(scaled.target.marker_positions_m[2], 0.3939, 1e-12);
  EXPECT_EQ(scaled.target.scale_sigma_rel, 0.0003);
}

}  // namespace
}  // namespace rigcal
