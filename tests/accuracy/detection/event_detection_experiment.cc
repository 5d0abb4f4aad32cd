// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/event_detection_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/event_decoder.h"
#include "agent/event/evt3_writer.h"
#include "common/camera/camera_model.h"
#include "common/simulation/events/event_renderer.h"
#include "common/simulation/world/random_stream.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/detection/textbook_chain.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

constexpr double kFoundPx = 3;
constexpr int64_t kSliceUs = 5000;

// The wand after `seconds` of uniform motion.
WandPose MovedBy(const WandMotion& at, double seconds) {
  WandPose now = at;
  now.origin_m += seconds * at.velocity_m_s;
  now.direction = (at.direction + seconds * at.angular_velocity_rad_s.cross(at.direction));
  now.direction.normalize();
  return now;
}

// Speed of the wand's middle in the image, px/s.
double ImageSpeed(const Intrinsics& intrinsics, const Target& target, const WandMotion& wand) {
  const SphereMotion middle = wand.Marker(0.5 * target.marker_positions_m.back());
  Eigen::Vector2d a, b;
  if (!Project(intrinsics, middle.centre_m, &a) ||
      !Project(intrinsics, middle.centre_m + 1e-3 * middle.velocity_m_s, &b)) {
    return 0;
  }
  return 1e3 * (b - a).norm();
}

std::optional<WandMotion> DrawWand(const EventDetectionOptions& options, uint64_t seed) {
  const Intrinsics& intrinsics = *options.camera.intrinsics;
  RandomWandPoseOptions pose = options.pose;
  pose.speed_m_s *= options.min_speed_share +
                    (1 - options.min_speed_share) * RandomStream{seed, 0x5beed}.Uniform();
  auto wand = RandomWandPose(intrinsics, options.camera.image_size_px, options.target, pose, seed);
  if (!wand.has_value()) return wand;
  const double speed = ImageSpeed(intrinsics, options.target, *wand);
  if (speed > options.max_speed_px_s) {
    wand->velocity_m_s *= options.max_speed_px_s / speed;
    wand->angular_velocity_rad_s *= options.max_speed_px_s / speed;
  }
  return wand;
}

bool IsShown(const EventDetectionOptions& options, const WandPose& wand) {
  return testing::WandVisible(*options.camera.intrinsics, options.camera.image_size_px,
                              options.target, wand);
}

EventOutput Evaluate(const EventDetectionOptions& options, const EventRenderer& renderer,
                     const WandPath& path, double now_s,
                     const std::vector<agent::BlinkBlob>& blobs) {
  EventOutput output;
  const auto wand = path ? path(now_s) : std::nullopt;
  if (!wand.has_value()) {
    output.false_blobs = static_cast<int>(blobs.size());
    return output;
  }
  output.shown = IsShown(options, *wand);
  const auto truth = renderer.TruthOf(*wand);
  output.centres.resize(truth.size());
  for (size_t k = 0; k < truth.size(); ++k) {
    output.centres[k].distance_m = wand->At(options.target.marker_positions_m[k]).norm();
    output.centres[k].radius_px = truth[k].radius_px;
  }
  for (const agent::BlinkBlob& blob : blobs) {
    const auto then = renderer.TruthOf(*path(1e-6 * blob.time_us));
    const auto later = renderer.TruthOf(*path(1e-6 * blob.time_us + 1e-3));
    double nearest = kFoundPx;
    size_t which = then.size();
    for (size_t k = 0; k < then.size(); ++k) {
      const double away = (blob.centre_px - then[k].centre_px).norm();
      if (away < nearest) nearest = away, which = k;
    }
    if (which == then.size()) {
      output.false_blobs += output.shown ? 1 : 0;
      continue;
    }
    EventCentre& centre = output.centres[which];
    if (centre.found && centre.error_px.norm() < nearest) continue;
    centre.found = true;
    centre.error_px = blob.centre_px - then[which].centre_px;
    centre.velocity_px_s = 1e3 * (later[which].centre_px - then[which].centre_px);
  }
  output.found = std::all_of(output.centres.begin(), output.centres.end(),
                             [](const EventCentre& centre) { return centre.found; });
  return output;
}

// Number of markers with a blob in them.
int CountFilled(const EventRenderer& renderer, const WandPose& wand,
                const std::vector<Eigen::Vector2d>& blobs_px) {
  int count = 0;
  for (const MarkerGroundTruth& marker : renderer.TruthOf(wand)) {
    count += std::any_of(blobs_px.begin(), blobs_px.end(), [&marker](const Eigen::Vector2d& blob) {
      return (blob - marker.centre_px).norm() < marker.radius_px;
    });
  }
  return count;
}

void VerifyWand(const EventDetectionOptions& options, const EventRenderer& renderer,
                const WandPath& path, const agent::Detection& detection, EventWands* wands) {
  ++wands->detections;
  const bool is_wand = detection.outcome == DetectionOutcome::kWand;
  const Observation& seen = detection.observation;
  const double time_s = 1e-9 * static_cast<double>(seen.time_ns);
  const auto wand = path ? path(time_s) : std::nullopt;
  if (!wand.has_value()) {
    wands->false_wands += is_wand ? 1 : 0;
    return;
  }
  const bool shown = IsShown(options, *wand);
  wands->shown += shown ? 1 : 0;
  if (!is_wand) return;
  bool good = true;
  for (size_t k = 0; k < seen.markers.size(); ++k) {
    if (!seen.markers[k].visible) {
      good = false;
      continue;
    }
    const double at_s = time_s + 1e-9 * seen.markers[k].time_delta_ns;
    const WandPose pose = *path(at_s);
    const MarkerGroundTruth then = renderer.TruthOf(pose)[k];
    EventCentre centre;
    centre.covariance_px2 = seen.markers[k].covariance_px2;
    centre.distance_m = pose.At(options.target.marker_positions_m[k]).norm();
    centre.radius_px = then.radius_px;
    centre.error_px = seen.markers[k].centre_px - then.centre_px;
    centre.velocity_px_s =
        1e3 * (renderer.TruthOf(*path(at_s + 1e-3))[k].centre_px - then.centre_px);
    centre.found = centre.error_px.norm() < kFoundPx;
    if (!centre.found) {
      ++wands->false_wands;
      return;
    }
    if (shown) wands->centres.push_back(centre);
  }
  wands->found += shown && good ? 1 : 0;
}

// Renders events and passes them to filter and detector as a sensor would.
class Chain {
 public:
  Chain(EventRenderer* renderer, agent::BlinkFilter* filter, agent::BlinkWandDetector* detector,
        TextbookChain* textbook, agent::SensorGeometry geometry)
      : renderer_(renderer),
        filter_(filter),
        detector_(detector),
        textbook_(textbook),
        decoder_(geometry) {}

  absl::Status RunTo(int64_t end_us, const WandPath& path, EventStreamResult* result) {
    while (renderer_->time_us() < end_us) {
      const int64_t to_us = std::min(end_us, renderer_->time_us() + kSliceUs);
      const auto begin = std::chrono::steady_clock::now();
      events_.clear();
      const absl::Status status = renderer_->Render(to_us, path, &events_, &triggers_);
      if (!status.ok()) return status;
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
      result->render_wall_s += took.count();
      result->events += events_.size();
      cd_events_.clear();
      for (const SimulatedEvent& event : events_) {
        cd_events_.push_back({event.time_us, event.x, event.y, event.on});
      }
      if (textbook_ != nullptr) textbook_->Take(cd_events_);
      bytes_.clear();
      writer_.Write(cd_events_, &bytes_);
      writer_.WriteTime(to_us, &bytes_);
      DecodeInBatches(decoder_, bytes_, *filter_);
      filter_->Sweep(static_cast<uint32_t>(to_us));
      detector_->Take(bytes_, &detections_);
    }
    return absl::OkStatus();
  }
  const std::vector<agent::Detection>& detections() const { return detections_; }

 private:
  EventRenderer* renderer_;
  agent::BlinkFilter* filter_;
  agent::BlinkWandDetector* detector_;
  TextbookChain* textbook_;
  std::vector<agent::Detection> detections_;
  agent::Evt3Decoder decoder_;
  agent::Evt3Writer writer_;
  std::vector<SimulatedEvent> events_;
  std::vector<SimulatedTrigger> triggers_;
  std::vector<agent::CdEvent> cd_events_;
  std::vector<uint8_t> bytes_;
};

EventStreamResult RunStream(const EventDetectionOptions& options, int stream) {
  EventStreamResult result;
  const uint64_t seed =
      static_cast<uint64_t>(options.seed) * 100000 + static_cast<uint64_t>(stream);
  EventRenderOptions sensor = options.sensor;
  sensor.seed = static_cast<uint32_t>(seed);
  sensor.led_phase = RandomStream{seed, 0x1ed}.Uniform();
  FrameRenderOptions scene = options.scene;
  scene.seed = sensor.seed;
  auto renderer = EventRenderer::Create(*options.camera.intrinsics, options.camera.image_size_px,
                                        options.target, scene, sensor);
  auto filter = agent::BlinkFilter::Create(options.filter);
  agent::BlinkWandDetectorOptions wand_options;
  wand_options.output.rate_hz = options.output_hz;
  auto detector = agent::BlinkWandDetector::Create(wand_options, options.target, options.camera,
                                                   agent::EventFormat::kEvt3, false);
  for (const absl::Status& status : {renderer.status(), filter.status(), detector.status()}) {
    result.status.Update(status);
  }
  if (!result.status.ok()) return result;
  const double middle_s = options.warm_up_s + 0.5 * options.outputs / options.output_hz;
  WandPath path;
  if (options.with_wand) {
    const auto wand = DrawWand(options, seed);
    if (!wand.has_value()) return result;
    path = [at = *wand, middle_s](double time_s) { return MovedBy(at, time_s - middle_s); };
  }
  std::optional<TextbookChain> textbook;
  if (options.textbook) {
    textbook.emplace(options.filter.geometry, options.filter.blink_hz.front(),
                     options.filter.band_rel);
  }
  Chain chain(&*renderer, &*filter, &*detector, textbook ? &*textbook : nullptr,
              options.filter.geometry);
  for (int k = 0; k < options.outputs; ++k) {
    const double now_s = options.warm_up_s + k / options.output_hz;
    const auto cells = std::llround(1e6 * now_s / EventRenderer::kCellUs);
    const int64_t now_us = cells * EventRenderer::kCellUs;
    result.status = chain.RunTo(now_us, path, &result);
    if (!result.status.ok()) return result;
    result.outputs.push_back(Evaluate(options, *renderer, path, 1e-6 * static_cast<double>(now_us),
                                      filter->FindBlobs(static_cast<uint32_t>(now_us))));
    result.outputs.back().seed = seed;
    if (textbook && path) {
      result.outputs.back().textbook_markers = CountFilled(
          *renderer, *path(1e-6 * static_cast<double>(now_us)), textbook->BlobsPx(now_us));
    }
  }
  for (const agent::Detection& detection : chain.detections()) {
    if (1e-9 * static_cast<double>(detection.observation.time_ns) < options.warm_up_s) continue;
    VerifyWand(options, *renderer, path, detection, &result.wands);
  }
  result.rendered_s = 1e-6 * static_cast<double>(renderer->time_us());
  return result;
}

}  // namespace

EventDetectionOptions PaperEventDetection() {
  EventDetectionOptions options;
  options.camera = PaperCamera({1280, 720}, 357);
  options.camera.sensor = SensorKind::kEvent;
  options.target = PaperWand();
  options.scene.clutter = 0.5;
  options.sensor.background_hz = 5e6 / (1280.0 * 720.0);
  options.sensor.bars = 4;
  options.pose.min_distance_m = 1.5;
  options.pose.max_distance_m = 5;
  options.pose.speed_m_s = 2;
  options.filter.geometry = {1280, 720};
  options.filter.blink_hz = {500};
  return options;
}

std::vector<EventStreamResult> RunEventDetection(const EventDetectionOptions& options) {
  return RunAll<EventStreamResult>(options.streams, options.threads,
                                   [&](int stream) { return RunStream(options, stream); });
}

}  // namespace rigcal::accuracy
