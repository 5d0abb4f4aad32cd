// SPDX-License-Identifier: Apache-2.0
// What bounds a search, and what it costs a wand to look like something else.
#include "agent/detect/frame/search_budget.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>

#include "agent/detect/frame/wand_detector.h"
#include "tests/agent/detect/frame/rendered_wand.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::agent::search_budget_test {
namespace {

Detection Find(RenderedWand& scene) {
  auto detector = WandDetector::Create({}, scene.target, scene.camera);
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

TEST(SearchBudget, WhatSpotsTookIsTakenOffTheWork) {
  SearchBudget budget;
  const double all = budget.work_left();
  budget.CutWork(0.5);
  EXPECT_EQ(budget.work_left(), all);
  budget.CutWork(3);
  const double left = budget.work_left();
  EXPECT_LT(left, all);
  // Work that was taken away is none that was done.
  EXPECT_DOUBLE_EQ(budget.EstimatedMs(3), 3);
  // Spent, it takes as long as is left, and nothing more is taken away for the same spots.
  EXPECT_EQ(budget.TakeWork(0.25 * left), 0.25 * left);
  budget.CutWork(3);
  EXPECT_NEAR(budget.work_left(), 0.75 * left, 1e-6);
  EXPECT_NEAR(budget.TakeWork(all), 0.75 * left, 1e-6);
  const double most_ms = budget.EstimatedMs(3);
  EXPECT_GT(most_ms, 4);
  // There is work for the last look at a wand even if none is left, and what it leaves goes back.
  EXPECT_EQ(budget.TakeWork(700), 0);
  EXPECT_EQ(budget.TakeWork(700, 500), 500);
  EXPECT_GT(budget.EstimatedMs(3), most_ms);
  EXPECT_EQ(budget.TakeWork(700), 0);
  budget.GiveBackWork(500);
  EXPECT_NEAR(budget.EstimatedMs(3), most_ms, 1e-9);
  budget.StartImage();
  EXPECT_EQ(budget.work_left(), all);
  budget.UseFits(100);
  budget.CutWork(4);
  EXPECT_LT(budget.TakeWork(all), left);
  EXPECT_NEAR(budget.EstimatedMs(4), most_ms, 1e-6);
  // Spots alone may take longer; then nothing is left, and never less.
  budget.CutWork(9);
  EXPECT_EQ(budget.work_left(), 0);
}

TEST(SearchBudget, DiscsThatCouldBeHundredsOfWandsEndTheSearchEarly) {
  RenderedWand scene;
  scene.Fill(0, 0, 640, 480, 20, 25, 30);
  AddWand(30, 100, 220, &scene);
  const Detection few = Find(scene);
  EXPECT_EQ(few.outcome, DetectionOutcome::kWand);
  EXPECT_FALSE(few.cut_short);
  for (int y = 20; y < 460; y += 44) {
    for (int x = 20; x < 620; x += 44) AddDisc(x, y, 6, 30, 100, 220, &scene);
  }
  const Detection many = Find(scene);
  EXPECT_TRUE(many.cut_short);
  EXPECT_NE(many.outcome, DetectionOutcome::kWand);
}

TEST(SearchBudget, AWandAmongMoreSmallThingsThanAreComparedIsFound) {
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
  const Detection detection = Find(scene);
  EXPECT_TRUE(detection.cut_short);
  ASSERT_EQ(detection.outcome, DetectionOutcome::kWand);
  for (size_t k = 0; k < 3; ++k) {
    const MarkerObservation& marker = detection.observation.markers[k];
    ASSERT_TRUE(marker.visible) << k;
    EXPECT_LT((marker.centre_px - truth.markers[k].centre_px).norm(), 0.2) << k;
  }
}

TEST(SearchBudget, WhiteThingsCostMoreInALitRoom) {
  RenderedWand scene;
  const auto confidence = [&scene](uint8_t room, uint8_t blue, uint8_t green, uint8_t red) {
    scene.Fill(0, 0, 640, 480, room, room, room);
    AddWand(blue, green, red, &scene);
    const Detection detection = Find(scene);
    EXPECT_EQ(detection.outcome, DetectionOutcome::kWand) << int{room};
    return detection.confidence;
  };
  // A dark room's spheres may be so bright that they are white.
  EXPECT_GT(confidence(5, 255, 255, 255), 0.9);
  EXPECT_GT(confidence(110, 30, 100, 230), 0.9);
  EXPECT_LT(confidence(110, 255, 255, 255), 0.9);
}

// LEDs of one wand are of one colour; labels of books are not.
TEST(SearchBudget, ColoursThatDifferCostInALitRoom) {
  RenderedWand scene;
  const auto confidence = [&scene](uint8_t room, uint8_t green) {
    scene.Fill(0, 0, 640, 480, room, room, room);
    AddWand(70, 120, 200, &scene);
    AddDisc(259, 200, 7, 70, green, 200, &scene);
    const Detection detection = Find(scene);
    EXPECT_EQ(detection.outcome, DetectionOutcome::kWand) << int{green};
    return detection.confidence;
  };
  const double alike = confidence(110, 120);
  EXPECT_GT(confidence(110, 130), alike - 0.01);
  EXPECT_LT(confidence(110, 150), alike - 0.04);
  EXPECT_GT(confidence(5, 150), alike - 0.02);
}

// Slats, keys and labels are in rows.
TEST(SearchBudget, ARowOfThingsThatGoesOnCostsInALitRoom) {
  RenderedWand scene;
  const auto confidence = [&scene](uint8_t room, int x, int y) {
    scene.Fill(0, 0, 640, 480, room, room, room);
    AddWand(30, 100, 230, &scene);
    AddDisc(x, y, 7, 30, 100, 230, &scene);
    const Detection detection = Find(scene);
    EXPECT_EQ(detection.outcome, DetectionOutcome::kWand) << x;
    return detection.confidence;
  };
  const double beside = confidence(110, 180, 260);
  EXPECT_GT(beside, 0.95);
  EXPECT_LT(confidence(110, 180, 200), beside - 0.03);
  EXPECT_GT(confidence(110, 180 - 78, 200), beside - 0.01);  // too far away
  EXPECT_GT(confidence(5, 180, 200), 0.95);
}

// The stick before a sphere makes its brightness lopsided, but not its outline.
TEST(SearchBudget, ANotchInARoundSphereCostsLittle) {
  RenderedWand scene;
  const FrameGroundTruth truth = scene.Render(RenderedWand::Wand({-0.2, 0.1, 1.2}, {1, 0.2, 0.2}));
  const double whole = Find(scene).confidence;
  for (const MarkerGroundTruth& marker : truth.markers) {
    const int x = static_cast<int>(std::lround(marker.centre_px.x()));
    const int y = static_cast<int>(std::lround(marker.centre_px.y()));
    scene.Fill(x - 1, y - 12, 2, 12, 30, 30, 30);
  }
  const Detection notched = Find(scene);
  ASSERT_EQ(notched.outcome, DetectionOutcome::kWand);
  EXPECT_EQ(notched.occluded_markers, 0);
  EXPECT_GT(notched.confidence, whole - 0.1);
}

}  // namespace
}  // namespace rigcal::agent::search_budget_test
