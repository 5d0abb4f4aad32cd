// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/other_spacing.h"

#include <utility>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::other_spacing_test {
namespace {

// What is said of the wand 0, 0.13, 0.39 m where the target says `middle_m`.
Detection Detected(RenderedWand* scene, double middle_m) {
  Target told = scene->target;
  told.marker_positions_m[1] = middle_m;
  auto detector = WandDetector::Create({}, told, scene->camera);
  EXPECT_THAT(detector, ::rigcal::testing::IsOk());
  auto detection = detector->Detect(scene->View(), 1, 0);
  EXPECT_THAT(detection, ::rigcal::testing::IsOk());
  return *std::move(detection);
}

TEST(OtherSpacing, IsSaidOfAWandOfAnotherSpacingOfWhichNoSphereIsLabelled) {
  for (const double tilt : {0.0, 0.2}) {
    RenderedWand scene;
    scene.Render(RenderedWand::Wand({-0.25, 0.1, 1.6}, {1, 0.2, tilt}));
    const Detection other = Detected(&scene, 0.16);
    EXPECT_NE(other.outcome, DetectionOutcome::kWand) << tilt;
    EXPECT_EQ(other.observation.VisibleCount(), 0) << tilt;
    EXPECT_NEAR(other.other_middle_share, 1.0 / 3, 0.03) << tilt;
    const Detection own = Detected(&scene, 0.13);
    EXPECT_EQ(own.outcome, DetectionOutcome::kWand) << tilt;
    EXPECT_EQ(own.other_middle_share, 0) << tilt;
  }
}

TEST(OtherSpacing, IsNotThatOfOneSphereOfAPairOrOfAWandPartlySeen) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.25, 0.1, 1.6}, {1, 0.2, 0}));
  const Eigen::Vector2d hidden = truth.markers[1].centre_px;
  scene.Fill(static_cast<int>(hidden.x()) - 14, static_cast<int>(hidden.y()) - 14, 28, 28, 9, 9, 9);
  EXPECT_EQ(Detected(&scene, 0.16).other_middle_share, 0);
}

TEST(OtherSpacing, SpheresOfAnotherDiameterAreNamedByTheirRatio) {
  RenderedWand scene;
  scene.Render(RenderedWand::Wand({-0.25, 0.1, 1.2}, {1, 0.2, 0}));
  for (const double ratio : {0.4, 2.5}) {
    Target told = scene.target;
    ASSERT_GT(told.diameter_m, 0);
    told.diameter_m /= ratio;
    auto detector = WandDetector::Create({}, told, scene.camera);
    ASSERT_THAT(detector, ::rigcal::testing::IsOk());
    const auto detection = detector->Detect(scene.View(), 1, 0);
    ASSERT_THAT(detection, ::rigcal::testing::IsOk());
    ASSERT_NE(detection->outcome, DetectionOutcome::kWand) << ratio;
    EXPECT_NEAR(detection->other_size_ratio, ratio, 0.15 * ratio);
    EXPECT_EQ(detection->other_middle_share, 0);
  }
}

}  // namespace
}  // namespace rigcal::agent::other_spacing_test
