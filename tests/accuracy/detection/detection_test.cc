// SPDX-License-Identifier: Apache-2.0
// A small part of `rigcal-accuracy detection`.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/detection/detection_experiment.h"

namespace rigcal::accuracy::detection_test {
namespace {

DetectionOptions Some(int rooms) {
  DetectionOptions options = PaperDetection();
  options.frames_per_room = 10;
  options.frames = 10 * rooms;
  options.seed = 3;
  return options;
}

TEST(Detection, FindsStationaryWandsInModerateClutter) {
  const DetectionSummary summary = Summarise(RunDetection(Some(10)));
  EXPECT_EQ(summary.failures, 0);
  EXPECT_GE(summary.shown, 95);
  // 99 % over many frames; a hundred may contain two hard ones.
  EXPECT_GE(summary.found, summary.shown - 3);
  EXPECT_EQ(summary.false_wands, 0);
  EXPECT_LE(summary.rms_px, 0.06);
}

TEST(Detection, FindsNoWandInEmptyFrames) {
  DetectionOptions options = Some(10);
  options.with_wand = false;
  const DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_EQ(summary.frames, 100);
  EXPECT_EQ(summary.false_wands, 0);
}

TEST(Detection, CovarianceIsConsistentWithoutClutter) {
  DetectionOptions options = Some(10);
  options.render.clutter = 0;
  const auto results = RunDetection(options);
  const DetectionSummary summary = Summarise(results);
  EXPECT_EQ(summary.found, summary.shown);
  EXPECT_LE(summary.rms_px, 0.03);
  // Some 290 centres of 2 degrees of freedom: 0.88 to 1.12 by chance alone.
  EXPECT_GT(summary.nees, 0.5);
  EXPECT_LT(summary.nees, 2);
}

TEST(Detection, AMosaicOfFiltersCostsLittle) {
  DetectionOptions options = Some(6);
  options.render.clutter = 0;
  options.render.bayer = true;
  const DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_EQ(summary.found, summary.shown);
  // Interpolated channels alone: 0.04 px.
  EXPECT_LE(summary.rms_px, 0.025);
  EXPECT_GT(summary.nees, 0.5);
  EXPECT_LT(summary.nees, 2);
}

TEST(Detection, LightFromAboveAndUnevenLedsMoveCentresLittle) {
  DetectionOptions options = Some(6);
  options.render.clutter = 0;
  options.render.lux = 10;
  options.render.overhead_lux = 500;
  options.render.led_cd_m2 = 300;
  options.render.auto_gain = true;
  options.render.bayer = true;
  DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_GE(summary.found, summary.shown - 1);
  EXPECT_LE(summary.bias_px, 0.05);  // of the centroid: 0.38
  EXPECT_LE(summary.rms_px, 0.15);
  options.render.overhead_lux = 0;
  options.render.led_gradient = options.render.led_uneven = 0.35;
  summary = Summarise(RunDetection(options));
  EXPECT_GE(summary.found, summary.shown - 1);
  EXPECT_LE(summary.rms_px, 0.1);  // of the centroid: 0.27
}

// Two spheres do not say which ones they are: a wand of which one is mostly hidden is none.
TEST(Detection, AHiddenSphereMakesNoFalseWand) {
  DetectionOptions options = Some(6);
  options.render.clutter = 0;
  options.render.lux = 10;
  options.render.occlusion = 1;
  const DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_GE(summary.visible_markers, 80);
  EXPECT_EQ(summary.false_wands, 0);
}

TEST(Detection, MotionGivesNoBias) {
  DetectionOptions options = Some(10);
  options.render.clutter = 0;
  options.pose.speed_m_s = 2;
  const DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_GE(summary.found, summary.shown - 2);
  EXPECT_LE(std::abs(summary.motion_bias_px), 0.05);
}

}  // namespace
}  // namespace rigcal::accuracy::detection_test
