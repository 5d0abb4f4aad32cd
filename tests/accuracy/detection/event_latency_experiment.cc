// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/event_latency_experiment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/simulation/frames/light_model.h"
#include "tests/accuracy/detection/paper_rig.h"

namespace rigcal::accuracy {
namespace {

constexpr double kShellReflectance = 0.5;  // of LightModel

// Of the room, at which the LED adds so much to the light of the sphere's shell.
double LuxFor(const FrameRenderOptions& scene, double contrast) {
  const Bgr colour = HueColour(scene.led_hue_deg, scene.led_saturation);
  const double led_cd_m2 = scene.led_cd_m2 * (colour[0] + colour[1] + colour[2]) / 3;
  return led_cd_m2 * std::numbers::pi / (kShellReflectance * contrast);
}

}  // namespace

std::vector<LatencyLight> LatencyLights() {
  std::vector<LatencyLight> lights;
  for (const double duty : {0.2, 0.5, 0.8}) {
    for (const double contrast : {1, 2, 3}) lights.push_back({duty, contrast});
  }
  return lights;
}

std::vector<LatencySensor> LatencySensors() {
  EventRenderOptions fast;
  fast.background_hz = 1;
  fast.bars = fast.lamps = fast.hot_pixels = 0;
  fast.refractory_us = 100;
  EventRenderOptions slow = fast;
  slow.latency_us = 150;
  slow.latency_slowdown = 1;  // the time constant goes with 1 / light
  EventRenderOptions uneven = slow;
  uneven.latency_us = 100;
  uneven.on_threshold = 0.2;
  uneven.off_threshold = 0.35;
  EventRenderOptions still = fast;
  still.refractory_us = 300;
  EventRenderOptions plain = fast;  // blind to what lasts shorter
  plain.refractory_us = EventRenderOptions{}.refractory_us;
  return {
      {"fast pixels, 50 Hz out", fast, 500, 50},    {"fast pixels, 200 Hz out", fast, 500, 200},
      {"fast pixels, 200 Hz wand", fast, 200, 200}, {"slow pixels, 50 Hz out", slow, 500, 50},
      {"slow pixels, 200 Hz out", slow, 500, 200},  {"slow pixels, 200 Hz wand", slow, 200, 200},
      {"uneven thresholds", uneven, 500, 200},      {"refractory 300 us", still, 500, 200},
      {"refractory 500 us", plain, 500, 200}};
}

LatencyPoint RunLatency(const LatencySensor& sensor, const LatencyLight& light, int streams,
                        uint32_t seed, int threads) {
  EventDetectionOptions options = PaperEventDetection();
  options.camera = PaperCamera({640, 480}, 240);
  options.camera.sensor = SensorKind::kEvent;
  options.filter.geometry = {640, 480};
  options.filter.blink_hz = options.target.blink_hz = {sensor.blink_hz};
  options.sensor = sensor.sensor;
  options.scene.clutter = 0;
  options.scene.blink_duty = light.duty;
  options.scene.lux = LuxFor(options.scene, light.contrast);
  options.pose.min_distance_m = 1.2;
  options.pose.max_distance_m = 2.5;
  options.pose.speed_m_s = 2;
  options.min_speed_share = 0.35;
  options.output_hz = sensor.output_hz;
  options.warm_up_s = 0.05;
  options.outputs = static_cast<int>(0.15 * sensor.output_hz);
  options.streams = streams;
  options.seed = seed;
  options.threads = threads;
  LatencyPoint point{.light = light};
  double along = 0, speed_squares = 0, squares = 0, scatter = 0;
  const auto results = RunEventDetection(options);
  const auto for_each = [&results](auto visit) {
    for (const EventStreamResult& result : results) {
      for (const EventCentre& centre : result.wands.centres) visit(centre);
    }
  };
  for (const EventStreamResult& result : results) {
    point.shown += result.wands.shown;
    point.found += result.wands.found;
    point.false_wands += result.wands.false_wands;
  }
  for_each([&](const EventCentre& centre) {
    ++point.centres;
    along -= centre.error_px.dot(centre.velocity_px_s);
    speed_squares += centre.velocity_px_s.squaredNorm();
    squares += centre.error_px.squaredNorm();
  });
  if (point.centres == 0) return point;
  const double latency_s = along / speed_squares;
  for_each([&](const EventCentre& centre) {
    const double left =
        (centre.error_px + latency_s * centre.velocity_px_s).dot(centre.velocity_px_s);
    scatter += left * left;
  });
  point.latency_us = 1e6 * latency_s;
  point.sigma_us = 1e6 * std::sqrt(scatter) / speed_squares;
  point.rms_px = std::sqrt(squares / (2 * point.centres));
  return point;
}

double LatencySpreadUs(const std::vector<LatencyPoint>& points) {
  double least = std::numeric_limits<double>::infinity(), most = -least;
  for (const LatencyPoint& point : points) {
    if (point.centres == 0) continue;
    least = std::min(least, point.latency_us);
    most = std::max(most, point.latency_us);
  }
  return most >= least ? most - least : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace rigcal::accuracy
