// SPDX-License-Identifier: Apache-2.0
// A small part of accuracy.detection.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/detection/detection_experiment.h"

namespace rigcal::accuracy::detection_test {
namespace {

DetectionOptions Some(int rooms) {
  DetectionOptions options = PaperDetection();
  options.pictures_per_room = 10;
  options.pictures = 10 * rooms;
  options.seed = 3;
  return options;
}

TEST(Detection, FindsStandingWandsInModerateClutter) {
  const DetectionSummary summary = Summarise(RunDetection(Some(10)));
  EXPECT_EQ(summary.failures, 0);
  EXPECT_GE(summary.shown, 95);
  // 99 % over many pictures; a hundred may hold two hard ones.
  EXPECT_GE(summary.found, summary.shown - 3);
  EXPECT_EQ(summary.false_wands, 0);
  EXPECT_LE(summary.rms_px, 0.06);
}

TEST(Detection, SeesNoWandWhereThereIsNone) {
  DetectionOptions options = Some(10);
  options.with_wand = false;
  const DetectionSummary summary = Summarise(RunDetection(options));
  EXPECT_EQ(summary.pictures, 100);
  EXPECT_EQ(summary.false_wands, 0);
}

TEST(Detection, CovarianceIsHonestWithoutClutter) {
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
