// SPDX-License-Identifier: Apache-2.0
// By how much the times of an event camera's centres are later than the light they belong to, over
// duty cycles and contrasts of the wand's LEDs. A seed is a stream of 0.2 s of a moving wand.
#include <fmt/core.h>

#include <cstdio>
#include <functional>
#include <string>

#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/event_latency_experiment.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

// The largest difference.
double PrintSensor(const std::string& name,
                   const std::function<LatencyPoint(const LatencyLight& light)>& run) {
  fmt::print("{}\n  duty  contrast  found %  false  latency us    rms px\n", name);
  std::vector<LatencyPoint> points;
  for (const LatencyLight& light : LatencyLights()) {
    const LatencyPoint& p = points.emplace_back(run(light));
    fmt::print("  {:3.0f} %  1:{:<6.0f}  {:7.1f}  {:5}  {:6.0f} ({:3.0f})  {:.4f}\n",
               100 * light.duty, light.contrast, 100.0 * p.found / std::max(1, p.shown),
               p.false_wands, p.latency_us, p.sigma_us, p.rms_px);
    std::fflush(stdout);
  }
  const double spread_us = LatencySpreadUs(points);
  fmt::print("  apart: {:.0f} us\n", spread_us);
  return spread_us;
}

int RunEventLatencies(const SeedOptions& seeds) {
  double largest_us = 0;
  const auto seed = static_cast<uint32_t>(seeds.first);
  for (const LatencySensor& sensor : LatencySensors()) {
    if (sensor.name.find(seeds.only) == std::string::npos) continue;
    const std::string name = fmt::format("{}: wand at {:.0f} Hz", sensor.name, sensor.blink_hz);
    const double spread_us = PrintSensor(name, [&](const LatencyLight& light) {
      return RunLatency(sensor, light, seeds.count, seed, seeds.threads);
    });
    largest_us = std::max(largest_us, spread_us);
  }
  for (const SecondLatencySensor& sensor : SecondLatencySensors()) {
    if (sensor.name.find(seeds.only) == std::string::npos) continue;
    const double spread_us = PrintSensor(sensor.name, [&](const LatencyLight& light) {
      return RunSecondLatency(sensor, light, seeds.count, seed, seeds.threads);
    });
    largest_us = std::max(largest_us, spread_us);
  }
  fmt::print("most apart before one sensor: {:.0f} us (at most 100)\n", largest_us);
  return 0;
}

}  // namespace

Experiment EventLatency() {
  SeedOptions defaults;
  defaults.count = 6;
  return SeedExperiment("event_latency",
                        "times of event centres against their light, by duty cycle and contrast",
                        defaults, RunEventLatencies);
}

}  // namespace rigcal::accuracy
