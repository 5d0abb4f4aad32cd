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

struct Searched {
  size_t last_level = 0;
  std::optional<VerifiedWand> wand;
};

// Of a wand before a window, the right side of whose third sphere is hidden from `right` radii on.
// `white`: whatever is of the wand's colour is.
Searched SearchHidden(double right, bool white = false) {
  FrameRenderOptions room = RenderedWand::QuietRoom();
  room.lux = 300;
  room.auto_gain = true;
  RenderedWand scene(room);
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.3, 1.2}, {1, 0, 0.1}));
  const MarkerGroundTruth& hidden = truth.markers[2];
  scene.Fill(0, 400, 640, 80, 255, 255, 255);
  scene.Fill(static_cast<int>(hidden.centre_px.x() + right * hidden.radius_px),
             static_cast<int>(hidden.centre_px.y()) - 20, 30, 40, 30, 30, 30);
  for (size_t i = 0; white && i < scene.pixels.size(); i += 3) {
    if (scene.pixels[i + 2] > 90) std::fill_n(scene.pixels.begin() + i, 3, uint8_t{255});
  }
  const WandDetectorOptions options;
  auto finder = SpotFinder::Create(options);
  EXPECT_THAT(finder, ::rigcal::testing::IsOk());
  WandSearch search(options, options.colour.washed_out_min, false, WandMechanisms{}, scene.target,
                    scene.camera, *std::move(finder));
  search.StartImage();
  Searched searched;
  searched.wand = search.SearchAll(scene.View()).wand;
  searched.last_level = search.spot_finder().level();
  return searched;
}

// Windows are full of pairs of white things.
TEST(WandSearch, TwoWhiteSpheresAndAPartAreNoWandInALitRoom) {
  for (const double right : {-0.5, -0.3, 0.0})
    EXPECT_FALSE(SearchHidden(right, true).wand) << right;
}

// The next level would be as much work again, and show no more of it.
TEST(WandSearch, ASurePartOfAMarkerEndsIt) {
  for (const double right : {-0.5, -0.3, 0.0}) {
    const Searched searched = SearchHidden(right);
    ASSERT_TRUE(searched.wand) << right;
    EXPECT_TRUE(searched.wand->has_part) << right;
    EXPECT_EQ(searched.wand->OccludedCount(), 1) << right;
    EXPECT_EQ(searched.last_level, SpotFinder::kPaleLevels[0]) << right;
  }
}

// One sphere is too dark for the search, whichever it is and wherever the wand points. Two spheres
// that are alike may also be the same the other way round.
TEST(WandSearch, AWandOfTwoSpheresBecomesWholeWithItsLabels) {
  for (const double turn : {1, -1}) {
    for (const double depth : {0.3, 0.0, -0.3}) {
      for (size_t dark = 0; dark < 3; ++dark) {
        RenderedWand scene;
        const FrameGroundTruth truth =
            scene.Render(RenderedWand::Wand({-0.2 * turn, 0.1, 2.2}, {turn, 0.2, depth}));
        scene.Dim(truth.markers[dark].centre_px, 14, {0.7, 0.7, 0.7});
        WandDetectorOptions options;
        options.colour.value_min = 140;
        const Detection detection = Detected(scene, options);
        ASSERT_EQ(detection.outcome, DetectionOutcome::kWand)
            << turn << ' ' << depth << ' ' << dark;
        for (size_t k = 0; k < 3; ++k) {
          const MarkerObservation& marker = detection.observation.markers[k];
          ASSERT_TRUE(marker.visible) << turn << ' ' << depth << ' ' << dark << ' ' << k;
          EXPECT_LT((marker.centre_px - truth.markers[k].centre_px).norm(), 0.1) << dark;
          EXPECT_GT(marker.label_confidence, 0.99) << turn << ' ' << depth << ' ' << dark;
        }
      }
    }
  }
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
