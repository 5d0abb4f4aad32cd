// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "tests/accuracy/detection/event_detection_experiment.h"
#include "tests/accuracy/detection/second_pixels.h"

namespace rigcal::accuracy {

// A sensor before which the wand is shown with several duty cycles and contrasts.
struct LatencySensor {
  std::string name;
  EventRenderOptions sensor;
  double blink_hz = 500;
  double output_hz = 200;
  double warm_up_s = 0.05;  // before the first output that counts
};

// A light of the wand: how much of each period it shines, and how often as much light the lit
// sphere adds as it reflects of the room.
struct LatencyLight {
  double duty = 0.5;
  double contrast = 1;
};

struct LatencyPoint {
  LatencyLight light;
  int shown = 0, found = 0, false_wands = 0;  // detections
  int centres = 0;
  double latency_us = 0;  // by which stamps are later than the light; along the motion
  double sigma_us = 0;    // of that, from its scatter
  double rms_px = 0;      // of each coordinate, with nothing subtracted
  double nees_along = 0;  // error along the motion squared over its stated variance, mean
};

// Duty cycles of 20, 50 and 80 %, contrasts of 1, 2 and 3.
std::vector<LatencyLight> LatencyLights();
// Fast and slow pixels, thresholds that differ, refractory periods, blink and output rates.
std::vector<LatencySensor> LatencySensors();

// Before a camera of 640x480 in a room without clutter; the wand is 1.2 to 2.5 m away and moves
// with 0.7 to 2 m/s.
LatencyPoint RunLatency(const LatencySensor& sensor, const LatencyLight& light, int streams,
                        uint32_t seed, int threads);

// Before pixels by other formulas (SecondPixelOptions), likewise.
struct SecondLatencySensor {
  std::string name;
  SecondPixelOptions sensor;
  double blink_hz = 500;
};
std::vector<SecondLatencySensor> SecondLatencySensors();
// Thresholds, bandwidth, refractory period, room and blur drawn from what sensors have.
SecondLatencySensor RandomSecondSensor(uint32_t seed, double blink_hz);
LatencyPoint RunSecondLatency(const SecondLatencySensor& sensor, const LatencyLight& light,
                              int streams, uint32_t seed, int threads);

// Between the largest and the smallest latency.
double LatencySpreadUs(const std::vector<LatencyPoint>& points);
// The same of those of one duty cycle, the largest: a wand mostly has one.
double LatencySpreadOfDutyUs(const std::vector<LatencyPoint>& points);

}  // namespace rigcal::accuracy
