// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/detection/event_detection_experiment.h"

namespace rigcal::accuracy::event_detection_test {
namespace {

// A small part of `rigcal-accuracy event_detection`, whose full run gives RMS 0.07 px; the limits
// are the required ones.
TEST(EventDetection, FindsMovingWandsAtTheRightTime) {
  EventDetectionOptions options = PaperEventDetection();
  options.streams = 3;
  options.outputs = 3;
  options.sensor.bars = 1;
  options.threads = 1;
  const EventDetectionSummary summary = Summarise(RunEventDetection(options));
  EXPECT_EQ(summary.failures, 0);
  ASSERT_GT(summary.shown, 0);
  EXPECT_EQ(summary.found, summary.shown);
  EXPECT_EQ(summary.false_blobs, 0);
  EXPECT_LT(summary.rms_px, 0.25);
  EXPECT_LT(std::abs(summary.latency_us), 300);
}

// A sigma off by a quarter (a variance off by a factor of 1.5) is outside these limits.
TEST(EventDetection, StatesConsistentCovariances) {
  EventDetectionOptions options = PaperEventDetection();
  options.streams = 8;
  options.output_hz = 200;
  options.outputs = 20;
  options.sensor.bars = options.sensor.lamps = 0;  // errors beside them are no noise
  options.threads = 1;
  const auto results = RunEventDetection(options);
  const EventDetectionSummary summary = Summarise(results);
  EXPECT_EQ(summary.failures, 0);
  ASSERT_GT(summary.wands.centres, 300);
  const double nees = 0.5 * (summary.wands.nees_along + summary.wands.nees_across);
  EXPECT_GT(nees, 0.8);
  EXPECT_LT(nees, 1.25);
  EXPECT_GT(summary.wands.nees_along, 0.7);
  EXPECT_LT(summary.wands.nees_along, 1.5);
  EXPECT_GT(summary.wands.nees_across, 0.7);
  EXPECT_LT(summary.wands.nees_across, 1.5);
}

TEST(EventDetection, FindsNothingWithoutAWand) {
  EventDetectionOptions options = PaperEventDetection();
  options.streams = 2;
  options.outputs = 3;
  options.with_wand = false;
  options.threads = 1;
  const EventDetectionSummary summary = Summarise(RunEventDetection(options));
  EXPECT_EQ(summary.failures, 0);
  EXPECT_EQ(summary.outputs, 6);
  EXPECT_EQ(summary.false_blobs, 0);
  EXPECT_EQ(summary.false_wands, 0);
}

}  // namespace
}  // namespace rigcal::accuracy::event_detection_test
