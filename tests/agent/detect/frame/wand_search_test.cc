// SPDX-License-Identifier: Apache-2.0
#include "agent/detect/frame/wand_search.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::wand_search_test {
namespace {

Detection Detected(const RenderedWand& scene, const WandDetectorOptions& options = {}) {
  auto detector = WandDetector::Create(options, scene.target, scene.camera);
  EXPECT_THAT(detector, ::rigcal::testing::IsOk());
  auto detection = detector->Detect(scene.View(), 1, 0);
  EXPECT_THAT(detection, ::rigcal::testing::IsOk());
  return *std::move(detection);
}

void AddDisc(int x0, int y0, int radius_px, uint8_t blue, uint8_t green, uint8_t red,
             RenderedWand* scene) {
  for (int y = -radius_px; y <= radius_px; ++y) {
    for (int x = -radius_px; x <= radius_px; ++x) {
      if (x * x + y * y < radius_px * radius_px) {
        scene->Fill(x0 + x, y0 + y, 1, 1, blue, green, red);
      }
    }
  }
}

// Spaced as on a wand across the line of sight.
void AddWand(uint8_t blue, uint8_t green, uint8_t red, RenderedWand* scene) {
  for (const int x : {220, 259, 337}) AddDisc(x, 200, 7, blue, green, red, scene);
}

TEST(WandSearch, DiscsThatCouldBeHundredsOfWandsEndTheSearchEarly) {
  RenderedWand scene;
  scene.Fill(0, 0, 640, 480, 20, 25, 30);
  AddWand(30, 100, 220, &scene);
  const Detection few = Detected(scene);
  EXPECT_EQ(few.outcome, DetectionOutcome::kWand);
  EXPECT_FALSE(few.cut_short);
  for (int y = 20; y < 460; y += 44) {
    for (int x = 20; x < 620; x += 44) AddDisc(x, y, 6, 30, 100, 220, &scene);
  }
  const Detection many = Detected(scene);
  EXPECT_TRUE(many.cut_short);
  EXPECT_NE(many.outcome, DetectionOutcome::kWand);
}

TEST(WandSearch, AWandAmongMoreSmallThingsThanAreComparedIsFound) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.3, 0.1, 1.6}, {1, 0.2, 0.2}));
  for (int y = 20; y < 460; y += 16) {
    for (int x = 20; x < 620; x += 16) {
      bool free = true;
      for (const MarkerGroundTruth& marker : truth.markers) {
        free &= (marker.centre_px - Eigen::Vector2d(x, y)).norm() > 24;
      }
      if (free) scene.Fill(x + y % 5, y + x % 7, 3, 3, 60, 140, 245);
    }
  }
  const Detection detection = Detected(scene);
  EXPECT_TRUE(detection.cut_short);
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    ASSERT_TRUE(marker.visible) << k;
    EXPECT_LT((marker.centre_px - truth.markers[k].centre_px).norm(), 0.2) << k;
  }
}

TEST(WandSearch, WhiteThingsCostMoreInALitRoom) {
  RenderedWand scene;
  const auto confidence = [&scene](uint8_t room, uint8_t blue, uint8_t green, uint8_t red) {
    scene.Fill(0, 0, 640, 480, room, room, room);
    AddWand(blue, green, red, &scene);
    const Detection detection = Detected(scene);
    EXPECT_EQ(detection.outcome, DetectionOutcome::kWand) << int{room};
    return detection.confidence;
  };
  // A dark room's spheres may be so bright that they are white.
  EXPECT_GT(confidence(5, 255, 255, 255), 0.9);
  EXPECT_GT(confidence(110, 30, 100, 230), 0.9);
  EXPECT_LT(confidence(110, 255, 255, 255), confidence(110, 70, 120, 200) - 0.04);
}

// LEDs of one wand are of one colour; labels of books are not.
TEST(WandSearch, ColoursThatDifferCostInALitRoom) {
  RenderedWand scene;
  const auto confidence = [&scene](uint8_t room, uint8_t green) {
    scene.Fill(0, 0, 640, 480, room, room, room);
    AddWand(70, 120, 200, &scene);
    AddDisc(259, 200, 7, 70, green, 200, &scene);
    const Detection detection = Detected(scene);
    EXPECT_EQ(detection.outcome, DetectionOutcome::kWand) << int{green};
    return detection.confidence;
  };
  const double alike = confidence(110, 120);
  EXPECT_GT(confidence(110, 130), confidence(110, 150));
  EXPECT_LT(confidence(110, 150), alike);
  EXPECT_GT(confidence(5, 150), alike - 0.02);
}

// The stick before a sphere makes its brightness lopsided, but not its outline.
TEST(WandSearch, ANotchInARoundSphereCostsLittle) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 1.2}, {1, 0.2, 0.2}));
  const double whole = Detected(scene).confidence;
  for (const MarkerGroundTruth& marker : truth.markers) {
    const int x = static_cast<int>(std::lround(marker.centre_px.x()));
    const int y = static_cast<int>(std::lround(marker.centre_px.y()));
    scene.Fill(x - 1, y - 12, 2, 12, 30, 30, 30);
  }
  const Detection notched = Detected(scene);
  ASSERT_EQ(notched.outcome, DetectionOutcome::kWand);
  EXPECT_EQ(notched.occluded_markers, 0);
  EXPECT_GT(notched.confidence, whole - 0.1);
}

// Labels on books, whose outlines all fit badly.
TEST(WandSearch, ThreeLabelsOnBooksAreNoWand) {
  constexpr std::pair<uint32_t, double> kRooms[] = {{48, 0.6}, {9, 1.2}, {9, 1.5}};
  for (const auto& [seed, defocus_px] : kRooms) {
    FrameRenderOptions room = RenderedWand::QuietRoom();
    room.seed = seed;
    room.defocus_px = defocus_px;
    room.lux = 400;
    room.overhead_lux = 300;
    room.led_cd_m2 = 300;
    room.auto_gain = true;
    room.bayer = true;
    room.shelves = 4;
    RenderedWand scene(room);
    WandDetectorOptions options;
    options.min_confidence = 0.3;
    scene.Render(std::nullopt);
    EXPECT_NE(Detected(scene, options).outcome, DetectionOutcome::kWand) << seed;
    const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 2}, {1, 0.2, 0.1}));
    const Detection shown = Detected(scene, options);
    ASSERT_EQ(shown.outcome, DetectionOutcome::kWand) << seed;
    EXPECT_GT(shown.confidence, 0.9) << seed;
    for (size_t k = 0; k < 3; ++k) {
      const MarkerObservation& marker = shown.observation.markers[k];
      EXPECT_LT((marker.centre_px - truth.markers[k].centre_px).norm(), 0.3) << seed;
    }
  }
}

}  // namespace
}  // namespace rigcal::agent::wand_search_test
