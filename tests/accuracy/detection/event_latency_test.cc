// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "tests/accuracy/detection/event_latency_experiment.h"

namespace rigcal::accuracy::event_latency_test {
namespace {

// A small part of `rigcal-accuracy event_latency`.
TEST(EventLatency, TimesAreTheLightsBeforePixelsByOtherFormulas) {
  const SecondLatencySensor sensor = SecondLatencySensors().front();
  std::vector<LatencyPoint> points;
  for (const LatencyLight& light :
       {LatencyLight{0.2, 3}, LatencyLight{0.5, 1}, LatencyLight{0.8, 2}}) {
    const LatencyPoint point = RunSecondLatency(sensor, light, 1, 7, 1);
    EXPECT_GE(point.shown, 20);
    EXPECT_GE(point.found, 0.95 * point.shown);
    EXPECT_EQ(point.false_wands, 0);
    EXPECT_LT(std::abs(point.latency_us), 200) << light.duty << " " << light.contrast;
    EXPECT_LT(point.rms_px, 0.15);
    points.push_back(point);
  }
  EXPECT_LT(LatencySpreadUs(points), 150);
}

}  // namespace
}  // namespace rigcal::accuracy::event_latency_test
