// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/labels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <vector>

#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/calibrate.h"
#include "server/solve/rig/outliers.h"
#include "tests/server/solve/simulated_input.h"
#include "tests/testing/simulation_text.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::labels_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::ParseSimulationOptions;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Cameras on a circle of 3 m that look at the origin, and a wand there at each instant.
class Labels : public ::testing::Test {
 protected:
  void Make(int camera_count, int instant_count,
            std::vector<double> positions_m = {0, 0.13, 0.39}) {
    problem_.clocks.resize(1);
    problem_.target.marker_positions_m = std::move(positions_m);
    for (int c = 0; c < camera_count; ++c) {
      BundleCamera camera;
      camera.name = std::to_string(c);
      camera.intrinsics = IntrinsicsVector::Zero(9);
      camera.intrinsics.head<4>() << 1000, 1000, 640, 480;
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.9 * c, Eigen::Vector3d::UnitY()));
      camera.cam_from_rig = {turn, Eigen::Vector3d(0.01 * c, 0, 3)};
      problem_.cameras.push_back(camera);
    }
    for (int i = 0; i < instant_count; ++i) AddInstant(i);
  }

  void AddInstant(int index) {
    BundleInstant instant;
    instant.origin_m = {-0.2, 0.02 * index, 0.1};
    instant.direction = Eigen::Vector3d(0.8, 0.5, 0.3 + 0.05 * index).normalized();
    instant.first_observation = static_cast<int>(problem_.observations.size());
    instant.observation_count = static_cast<int>(problem_.cameras.size());
    for (int c = 0; c < instant.observation_count; ++c) {
      const auto count = static_cast<int>(problem_.target.marker_positions_m.size());
      BundleObservation observation;
      observation.camera = c;
      observation.first_marker = static_cast<int>(problem_.markers.size());
      observation.marker_count = count;
      for (int m = 0; m < count; ++m) {
        BundleMarker marker;
        marker.marker = m;
        const auto residual = MarkerResidualPx(problem_, instant, observation, marker);
        EXPECT_TRUE(residual);
        marker.centre_px = residual.value();  // of a centre at zero: where the marker is seen
        problem_.markers.push_back(marker);
      }
      problem_.observations.push_back(observation);
    }
    problem_.instants.push_back(instant);
    time_ns_.push_back(40'000'000 * index);
  }

  void Reverse(int observation) { FlipLabels(observation, &problem_); }
  std::vector<int> Find() { return FindFlippedLabels(problem_, time_ns_); }

  BundleProblem problem_;
  std::vector<int64_t> time_ns_;
};

TEST_F(Labels, StraightOnesAreLeftAlone) {
  Make(4, 10);
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Labels, AFlippedObservationIsFoundAndFlippingItTwiceChangesNothing) {
  Make(4, 10);
  Reverse(9);
  EXPECT_THAT(Find(), ElementsAre(9));
  Reverse(9);
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Labels, GeometryTellsWhereTheSpacingDoesNot) {
  Make(4, 10, {0, 0.2, 0.4});
  Reverse(9);
  EXPECT_THAT(Find(), ElementsAre(9));
}

TEST_F(Labels, OneMarkerWithAnothersLabelIsNoReversal) {
  Make(4, 10);
  const auto first = static_cast<size_t>(problem_.observations[9].first_marker);
  std::swap(problem_.markers[first].marker, problem_.markers[first + 1].marker);
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Labels, AMarkerAnywhereIsNoReversal) {
  Make(4, 10);
  problem_.markers[static_cast<size_t>(problem_.observations[9].first_marker)].centre_px = {5, 7};
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Labels, OfTwoCamerasTheMiddleMarkerTellsWhichIsFlipped) {
  Make(2, 10);
  Reverse(7);
  for (BundleInstant& instant : problem_.instants) instant.used = instant.first_observation != 6;
  EXPECT_THAT(Find(), ElementsAre(7));
}

TEST_F(Labels, OfTwoCamerasThatSeeTheEndsOnlyNoneIsBlamed) {
  Make(2, 10, {0, 0.39});
  Reverse(7);
  for (BundleInstant& instant : problem_.instants) instant.used = instant.first_observation != 6;
  EXPECT_THAT(Find(), IsEmpty());
}

TEST_F(Labels, AnInstantThatPointsAgainstItsNeighboursIsFlippedAsAWhole) {
  Make(2, 10, {0, 0.39});
  Reverse(6);
  Reverse(7);
  BundleInstant& instant = problem_.instants[3];
  instant.origin_m += 0.39 * instant.direction;
  instant.direction = -instant.direction;
  EXPECT_THAT(Find(), ElementsAre(6, 7));
}

TEST_F(Labels, AnInstantOfWhichTooLittleIsLeftSaysNothing) {
  Make(2, 10, {0, 0.39});
  problem_.markers.front().centre_px = {5, 7};
  EXPECT_EQ(ClassifyOutliers(&problem_), 2);  // the marker, and its instant
  EXPECT_FALSE(problem_.instants.front().used);
  for (size_t i = 1; i < problem_.instants.size(); ++i) EXPECT_TRUE(problem_.instants[i].used);
}

TEST_F(Labels, AnInstantWithoutOutliersCountsHoweverSmall) {
  Make(2, 10, {0, 0.39});
  for (BundleObservation& observation : problem_.observations) {
    if (observation.camera == 1) observation.marker_count = 1;
  }
  EXPECT_EQ(ClassifyOutliers(&problem_), 0);
}

TEST_F(Labels, OneCameraAloneSaysNothing) {
  Make(2, 10, {0, 0.1, 0.25, 0.39});
  for (size_t m = 4; m < 8; ++m) problem_.markers[m].centre_px = {5, 7};
  ClassifyOutliers(&problem_);
  EXPECT_FALSE(problem_.instants.front().used);
  EXPECT_TRUE(problem_.instants.back().used);
}

TEST_F(Labels, NoCamerasOrInstantsIsNothingToTurn) { EXPECT_THAT(Find(), IsEmpty()); }

TEST(LabelsOfARig, AreFlippedAndCountedAndCostNothing) {
  const auto straight_options = ParseSimulationOptions("seed=3;cameras=4;duration=20;outliers=0");
  const auto options = ParseSimulationOptions("seed=3;cameras=4;duration=20;outliers=0;swaps=0.05");
  ASSERT_THAT(options, IsOk());
  const auto straight = SimulatedWorld::Create(*straight_options, WandTarget());
  const auto world = SimulatedWorld::Create(*options, WandTarget());
  ASSERT_THAT(world, IsOk());
  const CalibrationOutcome reference = Calibrate(InputOf(*straight), {});
  const CalibrationOutcome outcome = Calibrate(InputOf(*world), {});
  ASSERT_THAT(outcome.result, IsOk());
  ASSERT_THAT(reference.result, IsOk());
  std::map<std::string, uint64_t> flipped;
  for (const Refusal& refusal : outcome.refused) {
    if (refusal.reason == RefusalReason::kLabelsFlipped) flipped[refusal.camera] += refusal.count;
  }
  ASSERT_EQ(flipped.size(), 4u);
  for (size_t c = 0; c < 4; ++c) {
    const CalibratedCamera& camera = outcome.result->cameras[c];
    const CalibratedCamera& expected = reference.result->cameras[c];
    EXPECT_NEAR(static_cast<double>(flipped[camera.camera]), 0.05 * camera.wand_count,
                0.03 * camera.wand_count);
    // Flipped labels are part of the figures.
    EXPECT_NEAR(camera.residuals.all.mean_px, expected.residuals.all.mean_px, 0.02);
    EXPECT_LE(camera.residuals.outlier_count, 3u);
    EXPECT_LT((camera.cam_from_rig.translation_m - expected.cam_from_rig.translation_m).norm(),
              1e-4);
  }
}

}  // namespace
}  // namespace rigcal::server::labels_test
