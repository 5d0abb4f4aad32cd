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

// Both parts of its period are longer than the refractory period, as those of a wand of 500 Hz are
// not at these duty cycles.
TEST(EventLatency, PixelsOfALongRefractoryPeriodSeeAWandOf200Hz) {
  const LatencySensor sensor = LatencySensors().back();
  ASSERT_EQ(sensor.blink_hz, 200);
  ASSERT_EQ(sensor.sensor.refractory_us, 500);
  std::vector<LatencyPoint> points;
  for (const LatencyLight& light : {LatencyLight{0.2, 1}, LatencyLight{0.8, 1}}) {
    points.push_back(RunLatency(sensor, light, 1, 1, 1));
    EXPECT_GE(points.back().shown, 20);
    EXPECT_EQ(points.back().found, points.back().shown);
  }
  EXPECT_LT(LatencySpreadUs(points), 100);
}

TEST(EventLatency, SpreadsAreOfAllLightsAndOfOneDutyCycle) {
  const auto point = [](double duty, double contrast, double latency_us) {
    LatencyPoint result{.light = {duty, contrast}};
    result.centres = 1;
    result.latency_us = latency_us;
    return result;
  };
  std::vector<LatencyPoint> points = {point(0.2, 1, 10), point(0.2, 3, 25), point(0.8, 1, 90),
                                      point(0.8, 3, 60)};
  EXPECT_DOUBLE_EQ(LatencySpreadUs(points), 80);
  EXPECT_DOUBLE_EQ(LatencySpreadOfDutyUs(points), 30);
  points.push_back({.light = {0.8, 2}});  // nothing found
  EXPECT_DOUBLE_EQ(LatencySpreadUs(points), 80);
  EXPECT_DOUBLE_EQ(LatencySpreadOfDutyUs(points), 30);
  EXPECT_TRUE(std::isnan(LatencySpreadUs({points.back()})));
}

TEST(EventLatency, RandomSensorsDifferAndAreRepeatable) {
  const SecondLatencySensor first = RandomSecondSensor(1, 500), other = RandomSecondSensor(2, 500);
  EXPECT_EQ(first.name, RandomSecondSensor(1, 200).name);
  EXPECT_NE(first.name, other.name);
  EXPECT_NE(first.sensor.on_threshold, other.sensor.on_threshold);
  EXPECT_NE(first.sensor.cutoff_hz, other.sensor.cutoff_hz);
}

}  // namespace
}  // namespace rigcal::accuracy::event_latency_test
