// SPDX-License-Identifier: Apache-2.0
// Images and settings that hold more, or less, than a wand.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "agent/detect/frame/colour_share.h"
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

TEST(HostileImages, WhiteOrangeAndNoiseAreAnsweredWithWhatTheyAre) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  scene.Fill(0, 0, 640, 480, 255, 255, 255);
  EXPECT_EQ(MustFind(detector, scene.View()).outcome, DetectionOutcome::kSaturated);
  scene.Fill(0, 0, 640, 480, 30, 110, 220);
  Detection detection = MustFind(detector, scene.View());
  EXPECT_EQ(detection.outcome, DetectionOutcome::kNoWand);
  EXPECT_EQ(detection.passed_share, 1);
  std::mt19937 random(5);
  for (uint8_t& grey : scene.pixels) grey = static_cast<uint8_t>(random());
  detection = MustFind(detector, scene.View());
  EXPECT_EQ(detection.outcome, DetectionOutcome::kTooManyBlobs);
  EXPECT_TRUE(detection.cut_short);
  EXPECT_GT(detection.passed_share, kCrowdedShare);
}

// Each marker of a wand that was found is one of the same wand.
bool IsOneOf(const Detection& detection, const std::vector<FrameGroundTruth>& wands) {
  return std::ranges::any_of(wands, [&](const FrameGroundTruth& wand) {
    for (size_t k = 0; k < wand.markers.size(); ++k) {
      const MarkerObservation& marker = detection.observation.markers[k];
      if (!marker.visible) continue;
      if ((marker.centre_px - wand.markers[k].centre_px).norm() > 1) return false;
    }
    return true;
  });
}

void AddBrighter(const std::vector<uint8_t>& other, RenderedWand* scene) {
  std::transform(other.begin(), other.end(), scene->pixels.begin(), scene->pixels.begin(),
                 [](uint8_t a, uint8_t b) { return std::max(a, b); });
}

TEST(HostileImages, TwoWandsAreNeverMixed) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  int refused = 0;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int i = 0; i < 40; ++i) {
    const auto place = [&] {
      return RenderedWand::Wand({0.4 * any(random) - 0.2, 0.4 * any(random), 2 + 0.3 * any(random)},
                                {1, any(random), 0.5 * any(random)});
    };
    std::vector<FrameGroundTruth> wands = {scene.Render(place())};
    const std::vector<uint8_t> first = scene.pixels;
    wands.push_back(scene.Render(place()));
    AddBrighter(first, &scene);
    const Detection detection = MustFind(detector, scene.View());
    refused += detection.outcome == DetectionOutcome::kAmbiguous ? 1 : 0;
    if (detection.outcome != DetectionOutcome::kWand) continue;
    EXPECT_TRUE(IsOneOf(detection, wands)) << i;
  }
  EXPECT_GE(refused, 20);
}

TEST(HostileImages, AWandOnAScreenIsNotMixedWithTheWand) {
  RenderedWand scene;
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  for (int i = 0; i < 8; ++i) {
    // What the screen shows is small, and on white.
    std::vector<FrameGroundTruth> wands = {
        scene.Render(RenderedWand::Wand({0.5, -0.5 + 0.1 * i, 3.2}, {1, 0.3, 0.1}))};
    const std::vector<uint8_t> shown = scene.pixels;
    wands.push_back(scene.Render(RenderedWand::Wand({-0.4, 0.1, 1.6}, {1, 0.1 * i, 0.2})));
    AddBrighter(shown, &scene);
    for (int y = 60; y < 300; ++y) {
      for (int x = 370; x < 620; ++x) {
        uint8_t* const pixel = &scene.pixels[static_cast<size_t>((y * 640 + x) * 3)];
        if (pixel[2] < 60) pixel[0] = pixel[1] = pixel[2] = 235;
      }
    }
    const Detection detection = MustFind(detector, scene.View());
    if (detection.outcome != DetectionOutcome::kWand) continue;
    EXPECT_TRUE(IsOneOf(detection, wands)) << i;
  }
}

TEST(HostileImages, AWandIsFoundAmongManyThingsUnlessOneOfItsSpheresIsHidden) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(Near());
  AddLabels(truth, &scene);
  ASSERT_OK_AND_ASSIGN(auto detector, WandDetector::Create({}, scene.target, scene.camera));
  const Detection detection = MustFind(detector, scene.View());
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    ASSERT_TRUE(marker.visible) << k;
    EXPECT_LT((marker.centre_px - truth.markers[k].centre_px).norm(), 0.5) << k;
  }
  const Eigen::Vector2d& hidden = truth.markers[2].centre_px;
  scene.Fill(static_cast<int>(std::lround(hidden.x())),
             static_cast<int>(std::lround(hidden.y())) - 12, 16, 24, 9, 9, 9);
  ASSERT_OK_AND_ASSIGN(auto another, WandDetector::Create({}, scene.target, scene.camera));
  EXPECT_NE(MustFind(another, scene.View()).outcome, DetectionOutcome::kWand);
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
