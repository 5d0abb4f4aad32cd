// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "common/camera/intrinsics_vector.h"
#include "server/solve/evaluate/intrinsics_choice.h"
#include "tests/testing/bundle_scene.h"

namespace rigcal::server::intrinsics_by_camera_test {
namespace {

using ::testing::HasSubstr;

constexpr size_t kCameras = 12;
constexpr int kFolds = 4;

struct Given {
  RigObservations rig;  // its index alone
  BundleProblem problem;
};

// Solved with the given intrinsics, of which those of camera 5 are wrong by this factor.
Given MakeGiven(double focal_factor, int instants) {
  testing::BundleSceneOptions options;
  options.camera_count = kCameras;
  options.instant_count = instants;
  Given given;
  given.problem = testing::MakeBundleScene(options).ground_truth;
  given.problem.cameras[5].intrinsics.head<2>() *= focal_factor;
  for (const BundleCamera& camera : given.problem.cameras) {
    CameraDescription& description = given.rig.index.cameras.emplace_back();
    description.camera = camera.name;
    description.image_size_px = {1280, 1024};
    description.intrinsics = FromVector(camera.model, camera.intrinsics);
  }
  return given;
}

IntrinsicsChoice Choose(const Given& given, const RigSolveOptions& options = {}) {
  return ChooseIntrinsicsByCamera(given.rig, given.problem, options, kFolds);
}

TEST(ChooseIntrinsicsByCamera, RightOnesAreKept) {
  const IntrinsicsChoice choice = Choose(MakeGiven(1, 150));
  EXPECT_FALSE(choice.refine);
  EXPECT_EQ(choice.refine_in_fold, std::vector<bool>(kFolds, false));
  EXPECT_EQ(choice.finding.kind, FindingKind::kIntrinsicsKept);
  EXPECT_GT(choice.given_px, 0.2);
}

TEST(ChooseIntrinsicsByCamera, TheWrongOnesOfOneCameraAloneAreRefined) {
  const IntrinsicsChoice choice = Choose(MakeGiven(1.02, 150));
  std::vector<bool> keep(kCameras, true);
  keep[5] = false;
  EXPECT_TRUE(choice.refine);
  EXPECT_EQ(choice.keep, keep);
  EXPECT_EQ(choice.refine_in_fold, std::vector<bool>(kFolds, true));
  EXPECT_EQ(choice.finding.kind, FindingKind::kIntrinsicsRefined);
  EXPECT_THAT(choice.finding.advice, HasSubstr("1 of 12 cameras"));
}

TEST(ChooseIntrinsicsByCamera, WhatIsToBeKeptIsKept) {
  RigSolveOptions options;
  options.keep_intrinsics.assign(kCameras, false);
  options.keep_intrinsics[5] = true;
  EXPECT_FALSE(Choose(MakeGiven(1.02, 150), options).refine);
}

TEST(ChooseIntrinsicsByCamera, TooFewViewsSayNothing) {
  const IntrinsicsChoice choice = Choose(MakeGiven(1.02, 30));
  EXPECT_FALSE(choice.refine);
  EXPECT_THAT(choice.finding.advice, HasSubstr("too little data"));
}

}  // namespace
}  // namespace rigcal::server::intrinsics_by_camera_test
