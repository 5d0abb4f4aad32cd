// SPDX-License-Identifier: Apache-2.0
// Images and settings that hold more, or less, than a wand.
#include <cmath>
#include <vector>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::hostile_images_test {
namespace {

Detection MustFind(WandDetector& detector, const ImageView& view) {
  auto detection = detector.Detect(view, 1, 0);
  EXPECT_THAT(detection, ::rigcal::testing::IsOk());
  return *std::move(detection);
}

WandMotion Near() { return RenderedWand::Wand({-0.3, 0.1, 1.6}, {1, 0.2, 0.2}); }

// Small squares of the wand's colour, away from `keep` by 40 px.
void AddLabels(const FrameGroundTruth& truth, RenderedWand* scene) {
  for (int y = 20; y < 460; y += 80) {
    for (int x = 20; x < 620; x += 80) {
      bool free = true;
      for (const MarkerGroundTruth& marker : truth.markers) {
        free &= (marker.centre_px - Eigen::Vector2d(x, y)).norm() > 40;
      }
      if (free) scene->Fill(x, y, 3 + x % 7, 9, 30, static_cast<uint8_t>(60 + x % 50), 190);
    }
  }
}

TEST(HostileImages, ARangeThatTakesEverythingIsAnsweredWithAMessage) {
  RenderedWand scene;
  scene.Render(Near());
  WandDetectorOptions options;
  options.colour = {.hue_min_deg = 0, .hue_max_deg = 359, .saturation_min = 0, .value_min = 1};
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create(options, scene.target, scene.camera));
  const Detection detection = MustFind(detector, scene.View());
  // Either the wand is seen in spite of it, or the share says why not.
  EXPECT_TRUE(detection.outcome == DetectionOutcome::kWand || detection.passed_share > 0.5);
}

TEST(HostileImages, TwoSpheresAndAPartAreFoundAmongManyThings) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(Near());
  AddLabels(truth, &scene);
  const MarkerGroundTruth& hidden = truth.markers[2];
  const int x = static_cast<int>(std::lround(hidden.centre_px.x()));
  const int y = static_cast<int>(std::lround(hidden.centre_px.y()));
  scene.Fill(x, y - 12, 16, 24, 9, 9, 9);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustFind(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  EXPECT_FALSE(detection.observation.markers[2].visible);
  for (const size_t k : {size_t{0}, size_t{1}}) {
    ASSERT_TRUE(detection.observation.markers[k].visible);
    EXPECT_LT((detection.observation.markers[k].centre_px - truth.markers[k].centre_px).norm(),
              0.5);
  }
}

TEST(HostileImages, TwoSpheresAloneAreNotLabelled) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(Near());
  const MarkerGroundTruth& hidden = truth.markers[2];
  scene.Fill(static_cast<int>(hidden.centre_px.x()) - 20,
             static_cast<int>(hidden.centre_px.y()) - 20, 40, 40, 9, 9, 9);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  EXPECT_NE(MustFind(detector, scene.View()).outcome, DetectionOutcome::kWand);
}

}  // namespace
}  // namespace rigcal::agent::hostile_images_test
