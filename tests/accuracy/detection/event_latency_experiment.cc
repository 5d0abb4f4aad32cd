// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/event_latency_experiment.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include "agent/detect/event/blink_wand_detector.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/world/random_stream.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

constexpr double kShellReflectance = 0.5;  // of LightModel

// Of the room, at which the LED adds so much to the light of the sphere's shell.
double LuxFor(const FrameRenderOptions& scene, double contrast) {
  const Bgr colour = HueColour(scene.led_hue_deg, scene.led_saturation);
  const double led_cd_m2 = scene.led_cd_m2 * (colour[0] + colour[1] + colour[2]) / 3;
  return led_cd_m2 * std::numbers::pi / (kShellReflectance * contrast);
}

bool AreWhole(const std::vector<MarkerGroundTruth>& discs, const ImageSize& size) {
  constexpr double kBesidePx = 3;
  return std::all_of(discs.begin(), discs.end(), [&size](const MarkerGroundTruth& disc) {
    const double room_px = disc.radius_px + kBesidePx;
    const Eigen::Vector2d& at = disc.centre_px;
    return at.x() > room_px && at.x() < size.width - room_px && at.y() > room_px &&
           at.y() < size.height - room_px;
  });
}

LatencyPoint PointOf(const LatencyLight& light, const std::vector<EventStreamResult>& results) {
  LatencyPoint point{.light = light};
  double along = 0, speed_squares = 0, squares = 0, scatter = 0, nees = 0;
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
    const double error = centre.error_px.dot(centre.velocity_px_s);
    nees += error * error / centre.velocity_px_s.dot(centre.covariance_px2 * centre.velocity_px_s);
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
  point.nees_along = nees / point.centres;
  return point;
}

EventDetectionOptions SmallEventDetection() {
  EventDetectionOptions options = PaperEventDetection();
  options.camera = PaperCamera({640, 480}, 240);
  options.camera.sensor = SensorKind::kEvent;
  options.pose.min_distance_m = 1.2;
  options.pose.max_distance_m = 2.5;
  options.pose.speed_m_s = 2;
  options.min_speed_share = 0.35;
  return options;
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
  return {{"fast pixels, 50 Hz out", fast, 500, 50},
          {"fast pixels, 200 Hz out", fast, 500, 200},
          {"fast pixels, 200 Hz wand", fast, 200, 200},
          {"slow pixels, 50 Hz out", slow, 500, 50},
          {"slow pixels, 200 Hz out", slow, 500, 200},
          {"slow pixels, 200 Hz wand", slow, 200, 200},
          {"uneven thresholds", uneven, 500, 200},
          {"refractory 300 us", still, 500, 200},
          {"refractory 500 us", plain, 500, 200, 0.3},  // what its pixels answer is found out
          {"refractory 300 us, 200 Hz wand", still, 200, 200},
          {"refractory 500 us, 200 Hz wand", plain, 200, 200}};
}

LatencyPoint RunLatency(const LatencySensor& sensor, const LatencyLight& light, int streams,
                        uint32_t seed, int threads) {
  EventDetectionOptions options = SmallEventDetection();
  options.filter.geometry = {640, 480};
  options.filter.blink_hz = options.target.blink_hz = {sensor.blink_hz};
  options.sensor = sensor.sensor;
  options.scene.clutter = 0;
  options.scene.blink_duty = light.duty;
  options.scene.lux = LuxFor(options.scene, light.contrast);
  options.output_hz = sensor.output_hz;
  options.warm_up_s = sensor.warm_up_s;
  options.outputs = static_cast<int>(0.15 * sensor.output_hz);
  options.streams = streams;
  options.seed = seed;
  options.threads = threads;
  return PointOf(light, RunEventDetection(options));
}

std::vector<SecondLatencySensor> SecondLatencySensors() {
  SecondPixelOptions fast, slow, uneven;
  slow.cutoff_hz = 1200;
  slow.follows_light = true;
  uneven.on_threshold = 0.18;
  uneven.off_threshold = 0.3;
  uneven.refractory_us = 200;
  return {{"second order, 3 kHz", fast},
          {"second order, 1.2 kHz, with the light", slow},
          {"second order, thresholds differ", uneven}};
}

SecondLatencySensor RandomSecondSensor(uint32_t seed, double blink_hz) {
  RandomStream draw{seed, 0x5e50};
  // As likely in each octave.
  const auto between = [&draw](double least, double most) {
    return least * std::pow(most / least, draw.Uniform());
  };
  SecondPixelOptions sensor;
  sensor.on_threshold = between(0.14, 0.38);
  sensor.off_threshold = std::clamp(sensor.on_threshold * between(0.65, 1.5), 0.12, 0.42);
  sensor.threshold_spread = draw.Uniform(0.04, 0.14);
  sensor.cutoff_hz = between(1500, 10'000);
  sensor.follows_light = draw.Uniform() < 0.5;
  sensor.refractory_us = between(40, 330);
  sensor.room_share = between(0.15, 0.9);
  sensor.edge_px = draw.Uniform(0.4, 1.1);
  return {fmt::format("{:.1f} kHz{}, thresholds {:.2f} {:.2f}, refractory {:.0f} us, room {:.2f}",
                      1e-3 * sensor.cutoff_hz, sensor.follows_light ? " with the light" : "",
                      sensor.on_threshold, sensor.off_threshold, sensor.refractory_us,
                      sensor.room_share),
          sensor, blink_hz};
}

LatencyPoint RunSecondLatency(const SecondLatencySensor& sensor, const LatencyLight& light,
                              int streams, uint32_t seed, int threads) {
  EventDetectionOptions options = SmallEventDetection();
  options.target.blink_hz = {sensor.blink_hz};
  constexpr double kWarmUpS = 0.05, kDurationS = 0.2;
  const auto run = [&](int stream) {
    EventStreamResult result;
    const uint64_t own = static_cast<uint64_t>(seed) * 100000 + static_cast<uint64_t>(stream);
    RandomStream draw{own, 0x2ec0d};
    RandomWandPoseOptions pose = options.pose;
    pose.speed_m_s *= draw.Uniform(options.min_speed_share, 1);
    const auto wand = RandomWandPose(*options.camera.intrinsics, options.camera.image_size_px,
                                     options.target, pose, own);
    if (!wand) return result;
    const DiscPath discs = [&](double time_s) {
      std::vector<MarkerGroundTruth> truth;
      const Eigen::Vector3d shift = (time_s - 0.5 * kDurationS) * wand->velocity_m_s;
      for (const double position_m : options.target.marker_positions_m) {
        truth.push_back(TruthOf(*options.camera.intrinsics, options.camera.image_size_px,
                                wand->At(position_m) + shift, SphereRadiusM(options.target)));
      }
      return truth;
    };
    SecondPixelOptions pixels = sensor.sensor;
    pixels.blink_hz = sensor.blink_hz;
    pixels.duty = light.duty;
    pixels.contrast = light.contrast;
    pixels.phase = draw.Uniform();
    pixels.seed = static_cast<uint32_t>(own);
    agent::BlinkWandDetectorOptions wand_options;
    wand_options.output.rate_hz = 200;
    auto detector = agent::BlinkWandDetector::Create(wand_options, options.target, options.camera,
                                                     agent::EventFormat::kEvt3, false);
    result.status = detector.status();
    if (!detector.ok()) return result;
    std::vector<uint8_t> bytes;
    agent::Evt3Writer().Write(
        RenderSecondPixels(pixels, options.camera.image_size_px, discs, kDurationS), &bytes);
    std::vector<agent::Detection> found;
    detector->Take(bytes, &found);
    detector->Finish(&found);
    for (const agent::Detection& detection : found) {
      const Observation& seen = detection.observation;
      const double time_s = 1e-9 * static_cast<double>(seen.time_ns);
      if (time_s < kWarmUpS || !AreWhole(discs(time_s), options.camera.image_size_px)) continue;
      ++result.wands.shown;
      double worst_px = 0;
      std::vector<EventCentre> centres;
      for (size_t k = 0; k < seen.markers.size(); ++k) {
        if (!seen.markers[k].visible) continue;
        const double at_s =
            1e-9 * static_cast<double>(seen.time_ns + seen.markers[k].time_delta_ns);
        const Eigen::Vector2d there_px = discs(at_s)[k].centre_px;
        EventCentre& centre = centres.emplace_back();
        centre.error_px = seen.markers[k].centre_px - there_px;
        centre.covariance_px2 = seen.markers[k].covariance_px2;
        centre.velocity_px_s = 1e3 * (discs(at_s + 1e-3)[k].centre_px - there_px);
        worst_px = std::max(worst_px, centre.error_px.norm());
      }
      constexpr double kFarPx = 3;
      result.wands.false_wands += worst_px >= kFarPx ? 1 : 0;
      if (centres.size() < seen.markers.size() || worst_px >= kFarPx) continue;
      ++result.wands.found;
      result.wands.centres.insert(result.wands.centres.end(), centres.begin(), centres.end());
    }
    return result;
  };
  return PointOf(light, RunAll<EventStreamResult>(streams, threads, run));
}

double LatencySpreadOfDutyUs(const std::vector<LatencyPoint>& points) {
  double most = 0;
  for (const LatencyPoint& point : points) {
    std::vector<LatencyPoint> like;
    std::copy_if(points.begin(), points.end(), std::back_inserter(like),
                 [&point](const LatencyPoint& p) { return p.light.duty == point.light.duty; });
    if (const double apart = LatencySpreadUs(like); apart > most) most = apart;
  }
  return most;
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
