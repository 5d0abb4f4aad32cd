// SPDX-License-Identifier: Apache-2.0
#include "server/solve/initialize/initialization.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/server/solve/exact_problem.h"
#include "tests/testing/bundle_scene.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::initialization_test {
namespace {

using ::rigcal::testing::BundleSceneOptions;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::MakeBundleScene;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Cameras in a ring with clocks that are right, and the ground truth as the reference sees it.
BundleProblem Ring(int cameras, int instants) {
  BundleSceneOptions options;
  options.camera_count = cameras;
  options.instant_count = instants;
  options.offset_s = 0;
  return MakeBundleScene(options).ground_truth;
}

void Forget(BundleProblem* problem) {
  for (BundleCamera& camera : problem->cameras) {
    if (!camera.pose_fixed) camera.cam_from_rig = {};
  }
  for (BundleInstant& instant : problem->instants) {
    instant.origin_m.setZero();
    instant.direction = Eigen::Vector3d::UnitX();
    instant.used = false;
  }
}

// Hides what camera c sees from an instant on, or before it.
void Unsee(size_t first_instant, size_t end_instant, int camera, BundleProblem* problem) {
  std::vector<BundleObservation> observations;
  for (size_t i = 0; i < problem->instants.size(); ++i) {
    BundleInstant& instant = problem->instants[i];
    const int first = instant.first_observation, count = instant.observation_count;
    instant.first_observation = static_cast<int>(observations.size());
    for (int o = first; o < first + count; ++o) {
      const BundleObservation& observation = problem->observations[static_cast<size_t>(o)];
      if (observation.camera == camera && i >= first_instant && i < end_instant) continue;
      observations.push_back(observation);
    }
    instant.observation_count = static_cast<int>(observations.size()) - instant.first_observation;
  }
  problem->observations = std::move(observations);
}

void ExpectPoses(const BundleProblem& problem, const BundleProblem& truth, double tolerance_m) {
  for (size_t c = 0; c < problem.cameras.size(); ++c) {
    const RigidTransform &pose = problem.cameras[c].cam_from_rig,
                         &true_pose = truth.cameras[c].cam_from_rig;
    EXPECT_LT((pose.SourceFromTargetTranslation() - true_pose.SourceFromTargetTranslation()).norm(),
              tolerance_m)
        << c;
    EXPECT_LT(pose.rotation.angularDistance(true_pose.rotation), 0.02) << c;
  }
}

TEST(FindInitialization, FindsAllPosesFromNothing) {
  const BundleProblem truth = Ring(5, 60);
  BundleProblem problem = truth;
  Forget(&problem);
  ASSERT_THAT(FindInitialization({}, &problem), IsOk());
  ExpectPoses(problem, truth, 0.05);
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    EXPECT_TRUE(problem.instants[i].used) << i;
    EXPECT_LT((problem.instants[i].origin_m - truth.instants[i].origin_m).norm(), 0.05) << i;
  }
  EXPECT_EQ(problem.cameras[0].cam_from_rig.translation_m,
            truth.cameras[0].cam_from_rig.translation_m);
}

TEST(FindInitialization, WhicheverCameraIsTheReference) {
  BundleProblem truth = Ring(4, 60);
  truth.cameras[0].pose_fixed = false;
  truth.cameras[2].pose_fixed = true;
  BundleProblem problem = truth;
  Forget(&problem);
  ASSERT_THAT(FindInitialization({}, &problem), IsOk());
  ExpectPoses(problem, truth, 0.05);
}

// 0 sees with 1, 1 with 2, 2 with 3, and no others with each other.
TEST(FindInitialization, ChainsCamerasThatNeverSeeTheWandTogether) {
  const BundleProblem truth = Ring(4, 150);
  BundleProblem problem = truth;
  Unsee(50, 150, 0, &problem);
  Unsee(100, 150, 1, &problem);
  Unsee(0, 50, 2, &problem);
  Unsee(0, 100, 3, &problem);
  Forget(&problem);
  ASSERT_THAT(FindInitialization({}, &problem), IsOk());
  ExpectPoses(problem, truth, 0.08);
}

TEST(FindInitialization, NamesGroupsThatShareNothing) {
  BundleProblem problem = Ring(4, 80);
  Unsee(40, 80, 0, &problem);
  Unsee(40, 80, 1, &problem);
  Unsee(0, 40, 2, &problem);
  Unsee(0, 40, 3, &problem);
  Forget(&problem);
  InitializationOptions options;
  options.camera_notes = {"", "", "", "clock of its own"};
  EXPECT_THAT(FindInitialization(options, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition,
                       AllOf(HasSubstr("{camera_0, camera_1}"),
                             HasSubstr("{camera_2, camera_3 (clock of its own)}"))));
}

TEST(FindInitialization, WithoutInstantsIsNotConnected) {
  BundleProblem problem = Ring(3, 0);
  EXPECT_THAT(FindInitialization({}, &problem),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not connected")));
}

TEST(FindInitialization, StopsWhenCancelled) {
  BundleProblem problem = Ring(3, 40);
  Forget(&problem);
  const std::atomic<bool> cancelled = true;
  InitializationOptions options;
  options.cancelled = &cancelled;
  EXPECT_THAT(FindInitialization(options, &problem),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
}

TEST(FindInitialization, ProgressNeverGoesBackOrBeyondOne) {
  BundleProblem problem = Ring(5, 40);
  Forget(&problem);
  double last = 0;
  InitializationOptions options;
  options.progress = [&last](double fraction) {
    EXPECT_GE(fraction, last);
    EXPECT_LE(fraction, 1);
    last = fraction;
  };
  ASSERT_THAT(FindInitialization(options, &problem), IsOk());
  EXPECT_NEAR(last, 1, 1e-9);
}

TEST(FindInitialization, EndsTheSameBitForBit) {
  BundleProblem first = Ring(4, 50);
  Forget(&first);
  BundleProblem second = first;
  ASSERT_THAT(FindInitialization({}, &first), IsOk());
  ASSERT_THAT(FindInitialization({}, &second), IsOk());
  for (size_t c = 0; c < first.cameras.size(); ++c) {
    EXPECT_EQ(first.cameras[c].cam_from_rig.rotation.coeffs(),
              second.cameras[c].cam_from_rig.rotation.coeffs());
    EXPECT_EQ(first.cameras[c].cam_from_rig.translation_m,
              second.cameras[c].cam_from_rig.translation_m);
  }
}

// ---- placing ----

const ExactWand kWand{{0.2, -0.1, 4}, {0.6, 0.3, 0.5}};

TEST(PlaceInstants, PlacesThoseWithoutAPose) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand, {{0, 0, 5}}});
  Forget(&problem);
  problem.cameras[1].cam_from_rig.translation_m = {-1, 0, 0};
  EXPECT_EQ(PlaceInstants(3, &problem), 2);
  EXPECT_LT((problem.instants[0].origin_m - kWand.origin_m).norm(), 1e-6);
  EXPECT_LT((problem.instants[1].origin_m - Eigen::Vector3d(0, 0, 5)).norm(), 1e-6);
}

TEST(PlaceInstants, DoesNotTouchAPoseThatAgrees) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.instants[0].origin_m.x() += 0.001;  // 0.25 px
  const Eigen::Vector3d before_m = problem.instants[0].origin_m;
  EXPECT_EQ(PlaceInstants(3, &problem), 1);
  EXPECT_EQ(problem.instants[0].origin_m, before_m);
}

TEST(PlaceInstants, ReplacesAPoseThatDoesNotAgree) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.instants[0].origin_m.x() += 0.3;
  problem.instants[0].direction = -problem.instants[0].direction;
  EXPECT_EQ(PlaceInstants(3, &problem), 1);
  EXPECT_LT((problem.instants[0].origin_m - kWand.origin_m).norm(), 1e-6);
}

TEST(PlaceInstants, ReplacesAPoseBehindACamera) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  problem.instants[0].origin_m = -problem.instants[0].origin_m;
  EXPECT_EQ(PlaceInstants(3, &problem), 1);
  EXPECT_LT((problem.instants[0].origin_m - kWand.origin_m).norm(), 1e-6);
}

TEST(PlaceInstants, GivesUpWhatCannotBePlaced) {
  // One camera sees it; two at one place do; nothing is finite.
  BundleProblem alone = ExactProblem({{0, 0, 0}}, {kWand});
  alone.instants[0].used = false;
  EXPECT_EQ(PlaceInstants(3, &alone), 0);
  BundleProblem together = ExactProblem({{1, 0, 0}, {1, 0, 0}}, {kWand});
  together.instants[0].used = false;
  EXPECT_EQ(PlaceInstants(3, &together), 0);
  BundleProblem broken = ExactProblem({{0, 0, 0}, {1, 0, 0}}, {kWand});
  broken.instants[0].used = false;
  for (BundleMarker& marker : broken.markers) marker.centre_px.setConstant(kNaN);
  EXPECT_EQ(PlaceInstants(3, &broken), 0);
  EXPECT_FALSE(broken.instants[0].used);
  BundleProblem empty;
  EXPECT_EQ(PlaceInstants(3, &empty), 0);
}

// A camera that claims to see what lies behind it would stop the bundle adjustment.
TEST(PlaceInstants, DoesNotPlaceWhatLiesBehindACameraThatSaysItSeesIt) {
  BundleProblem problem = ExactProblem({{0, 0, 0}, {1, 0, 0}, {0, 0, 8}}, {kWand});
  problem.instants[0].used = false;
  EXPECT_EQ(PlaceInstants(3, &problem), 0);
  for (size_t m = 6; m < 9; ++m) problem.markers[m].used = false;
  EXPECT_EQ(PlaceInstants(3, &problem), 1);
}

}  // namespace
}  // namespace rigcal::server::initialization_test
