// SPDX-License-Identifier: Apache-2.0
// By how much the times of an event camera's centres are later than the light they belong to, over
// duty cycles and contrasts of the wand's LEDs. A seed is a stream of 0.2 s of a moving wand.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "common/statistics/robust_statistics.h"
#include "tests/accuracy/detection/detection_experiments.h"
#include "tests/accuracy/detection/event_latency_experiment.h"
#include "tests/accuracy/seed_options.h"

namespace rigcal::accuracy {
namespace {

constexpr double kGoalUs = 100;

// The largest difference.
double PrintSensor(const std::string& name,
                   const std::function<LatencyPoint(const LatencyLight& light)>& run) {
  fmt::print("{}\n  duty  contrast  found %  false  latency us    rms px  NEES along\n", name);
  std::vector<LatencyPoint> points;
  for (const LatencyLight& light : LatencyLights()) {
    const LatencyPoint& p = points.emplace_back(run(light));
    fmt::print("  {:3.0f} %  1:{:<6.0f}  {:7.1f}  {:5}  {:6.0f} ({:3.0f})  {:.4f}  {:6.2f}\n",
               100 * light.duty, light.contrast, 100.0 * p.found / std::max(1, p.shown),
               p.false_wands, p.latency_us, p.sigma_us, p.rms_px, p.nees_along);
    std::fflush(stdout);
  }
  const double spread_us = LatencySpreadUs(points);
  fmt::print("  apart: {:.0f} us, at one duty cycle {:.0f} us\n", spread_us,
             LatencySpreadOfDutyUs(points));
  return spread_us;
}

// As many sensors as seeds, each before one stream of each light.
void PrintRandomSensors(const SeedOptions& seeds, double blink_hz) {
  const std::string name = fmt::format("random sensors: wand at {:.0f} Hz", blink_hz);
  if (name.find(seeds.only) == std::string::npos) return;
  fmt::print("{}: apart (at one duty cycle), each light, us\n", name);
  std::vector<double> spreads_us;
  for (int i = 0; i < seeds.count; ++i) {
    const auto seed = static_cast<uint32_t>(seeds.first + i);
    const SecondLatencySensor sensor = RandomSecondSensor(seed, blink_hz);
    std::vector<LatencyPoint> points;
    std::string latencies;
    for (const LatencyLight& light : LatencyLights()) {
      const LatencyPoint point = RunSecondLatency(sensor, light, 1, seed, seeds.threads);
      latencies += fmt::format("{:5.0f}", point.latency_us);
      if (2 * point.found > point.shown) points.push_back(point);
    }
    spreads_us.push_back(LatencySpreadUs(points));
    fmt::print("  {:4.0f} ({:3.0f}) {}  {} of 9 lights found  {}\n", spreads_us.back(),
               LatencySpreadOfDutyUs(points), latencies, points.size(), sensor.name);
    std::fflush(stdout);
  }
  std::erase_if(spreads_us, [](double us) { return !std::isfinite(us); });
  if (spreads_us.empty()) return;
  const auto within =
      std::count_if(spreads_us.begin(), spreads_us.end(), [](double us) { return us <= kGoalUs; });
  fmt::print("  median {:.0f} us; at most {:.0f} us before {} of {} sensors\n",
             UpperMedian(spreads_us), kGoalUs, within, spreads_us.size());
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
  if (largest_us > 0) {
    fmt::print("most apart before one sensor: {:.0f} us (at most {:.0f})\n", largest_us, kGoalUs);
  }
  for (const double blink_hz : {500.0, 200.0}) PrintRandomSensors(seeds, blink_hz);
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
