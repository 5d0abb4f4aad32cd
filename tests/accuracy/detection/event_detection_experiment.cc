// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/event_detection_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "agent/detect/event/blink_wand_detector.h"
#include "agent/event/event_decoder.h"
#include "agent/event/evt3_writer.h"
#include "common/camera/camera_model.h"
#include "common/simulation/events/event_renderer.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/detection/textbook_chain.h"
#include "tests/accuracy/seed_runs.h"

namespace rigcal::accuracy {
namespace {

constexpr double kFoundPx = 3;
constexpr double kWholePx = 2;  // of a sphere seen whole, from the border
constexpr double kCoverPx = 4;  // around a sphere that something hides
constexpr int64_t kSliceUs = 5000;
constexpr uint64_t kSecondWand = 50'000'000;  // added to the seed

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

// Sideways, until the centre of the end that is nearest to a border is on it: the other markers
// stay in the image.
void MoveToBorder(const EventDetectionOptions& options, WandMotion* wand) {
  const Intrinsics& intrinsics = *options.camera.intrinsics;
  const Eigen::Vector2d last_px(options.camera.image_size_px.width - 1.0,
                                options.camera.image_size_px.height - 1.0);
  double nearest_px = std::numeric_limits<double>::infinity();
  double end_m = 0;
  int axis = 0;
  bool is_far = false;  // the border at the last column or row
  for (const double each_m : {0.0, options.target.marker_positions_m.back()}) {
    Eigen::Vector2d at;
    if (!Project(intrinsics, wand->At(each_m), &at)) return;
    for (const int i : {0, 1}) {
      for (const bool far : {false, true}) {
        const double away_px = far ? last_px[i] - at[i] : at[i];
        if (away_px < nearest_px) nearest_px = away_px, end_m = each_m, axis = i, is_far = far;
      }
    }
  }
  for (int round = 0; round < 5; ++round) {  // a lens bends the way
    const Eigen::Vector3d end = wand->At(end_m);
    Eigen::Vector2d at;
    if (!Project(intrinsics, end, &at)) return;
    const double way_px = (is_far ? last_px[axis] : 0) - at[axis];
    wand->origin_m[axis] += end.z() * way_px / (axis == 0 ? intrinsics.fx_px : intrinsics.fy_px);
  }
}

// Moved so that the middles of both are seen in one direction.
WandMotion CrossingAt(const EventDetectionOptions& options, const WandPose& first,
                      WandMotion second) {
  const double middle_m = 0.5 * options.target.marker_positions_m.back();
  const Eigen::Vector3d there = first.At(middle_m).normalized() * second.At(middle_m).norm();
  second.origin_m += there - second.At(middle_m);
  return second;
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

// A wand in a stream.
struct ShownWand {
  WandPath path;
  std::optional<size_t> hidden;  // marker, from then on
  double hidden_from_s = 0;

  bool Hides(size_t marker, double time_s) const {
    return hidden == marker && time_s >= hidden_from_s;
  }
};

struct VerifiedMarkers {
  std::vector<EventCentre> centres;  // of those delivered
  double worst_px = 0;
  int found = 0;
};

VerifiedMarkers CompareWith(const EventDetectionOptions& options, const EventRenderer& renderer,
                            const WandPath& path, const Observation& seen) {
  VerifiedMarkers result;
  for (size_t k = 0; k < seen.markers.size(); ++k) {
    if (!seen.markers[k].visible) continue;
    const double at_s = 1e-9 * static_cast<double>(seen.time_ns + seen.markers[k].time_delta_ns);
    const WandPose pose = *path(at_s);
    const MarkerGroundTruth then = renderer.TruthOf(pose)[k];
    EventCentre& centre = result.centres.emplace_back();
    centre.covariance_px2 = seen.markers[k].covariance_px2;
    centre.distance_m = pose.At(options.target.marker_positions_m[k]).norm();
    centre.radius_px = then.radius_px;
    centre.error_px = seen.markers[k].centre_px - then.centre_px;
    centre.velocity_px_s =
        1e3 * (renderer.TruthOf(*path(at_s + 1e-3))[k].centre_px - then.centre_px);
    centre.found = centre.error_px.norm() < kFoundPx;
    result.found += centre.found ? 1 : 0;
    result.worst_px = std::max(result.worst_px, centre.error_px.norm());
  }
  return result;
}

// Those seen whole; none where that is less than two.
int WholeSpheres(const EventDetectionOptions& options, const EventRenderer& renderer,
                 const ShownWand& wand, double time_s) {
  const auto truth = renderer.TruthOf(*wand.path(time_s));
  const double width = options.camera.image_size_px.width;
  const double height = options.camera.image_size_px.height;
  int whole = 0;
  for (size_t k = 0; k < truth.size(); ++k) {
    const Eigen::Vector2d& at = truth[k].centre_px;
    const double room_px = truth[k].radius_px + kWholePx;
    whole += truth[k].inside && at.x() > room_px && at.x() < width - 1 - room_px &&
                     at.y() > room_px && at.y() < height - 1 - room_px && !wand.Hides(k, time_s)
                 ? 1
                 : 0;
  }
  return whole < 2 ? 0 : whole;
}

void VerifyWand(const EventDetectionOptions& options, const EventRenderer& renderer,
                const std::vector<ShownWand>& shown_wands, const agent::Detection& detection,
                EventWands* wands) {
  ++wands->detections;
  const bool is_wand = detection.outcome == DetectionOutcome::kWand;
  wands->ambiguous += detection.outcome == DetectionOutcome::kAmbiguous ? 1 : 0;
  const Observation& seen = detection.observation;
  const double time_s = 1e-9 * static_cast<double>(seen.time_ns);
  if (shown_wands.empty()) {
    wands->false_wands += is_wand ? 1 : 0;
    return;
  }
  const ShownWand& first = shown_wands.front();
  const bool shown = IsShown(options, *first.path(time_s)) && !first.Hides(0, time_s) &&
                     !first.Hides(1, time_s) && !first.Hides(2, time_s);
  const int spheres = WholeSpheres(options, renderer, first, time_s);
  wands->shown += shown ? 1 : 0;
  wands->spheres_shown += spheres;
  if (!is_wand) return;
  // All markers must be of one wand.
  VerifiedMarkers best = CompareWith(options, renderer, first.path, seen);
  for (size_t i = 1; i < shown_wands.size(); ++i) {
    VerifiedMarkers other = CompareWith(options, renderer, shown_wands[i].path, seen);
    if (other.worst_px < best.worst_px) best = std::move(other);
  }
  if (best.worst_px >= kFoundPx) {
    ++wands->false_wands;
    return;
  }
  wands->spheres_found += std::min(spheres, best.found);
  if (shown) wands->centres.insert(wands->centres.end(), best.centres.begin(), best.centres.end());
  wands->found += shown && best.centres.size() == seen.markers.size() ? 1 : 0;
}

// Renders events and passes them to filter and detector as a sensor would.
class Chain {
 public:
  Chain(EventRenderer* renderer, agent::BlinkFilter* filter, agent::BlinkWandDetector* detector,
        TextbookChain* textbook, agent::SensorGeometry geometry, EventRenderer* second,
        std::vector<ShownWand> wands, const testing::EventDisturbance& disturbance)
      : renderer_(renderer),
        second_(second),
        wands_(std::move(wands)),
        disturber_(disturbance),
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
      RIGCAL_RETURN_IF_ERROR(AddSecondWand(to_us));
      HideSphere();
      disturber_.Apply(&events_);
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
  // As if neither wand hid the other.
  absl::Status AddSecondWand(int64_t to_us) {
    if (second_ == nullptr) return absl::OkStatus();
    const auto middle = static_cast<std::ptrdiff_t>(events_.size());
    RIGCAL_RETURN_IF_ERROR(second_->Render(to_us, wands_[1].path, &events_, &triggers_));
    std::inplace_merge(
        events_.begin(), events_.begin() + middle, events_.end(),
        [](const SimulatedEvent& a, const SimulatedEvent& b) { return a.time_us < b.time_us; });
    return absl::OkStatus();
  }

  // Something black and still moves along before it.
  void HideSphere() {
    if (wands_.empty() || !wands_[0].hidden || events_.empty()) return;
    const size_t hidden = *wands_[0].hidden;
    int64_t drawn_us = -1;
    MarkerGroundTruth at;
    std::erase_if(events_, [&](const SimulatedEvent& event) {
      const double time_s = 1e-6 * static_cast<double>(event.time_us);
      if (!wands_[0].Hides(hidden, time_s)) return false;
      if (event.time_us > drawn_us + kDrawUs) {
        at = renderer_->TruthOf(*wands_[0].path(time_s))[hidden];
        drawn_us = event.time_us;
      }
      return (Eigen::Vector2d(event.x, event.y) - at.centre_px).norm() < at.radius_px + kCoverPx;
    });
  }

  static constexpr int64_t kDrawUs = 500;
  EventRenderer* renderer_;
  EventRenderer* second_;
  std::vector<ShownWand> wands_;
  testing::EventDisturber disturber_;
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
  wand_options.band_rel = options.band_rel;
  auto detector = agent::BlinkWandDetector::Create(wand_options, options.target, options.camera,
                                                   agent::EventFormat::kEvt3, false);
  for (const absl::Status& status : {renderer.status(), filter.status(), detector.status()}) {
    result.status.Update(status);
  }
  if (!result.status.ok()) return result;
  const double middle_s = options.warm_up_s + 0.5 * options.outputs / options.output_hz;
  WandPath path;
  std::vector<ShownWand> wands;
  const auto add_wand = [&](const WandMotion& wand) {
    ShownWand& shown = wands.emplace_back();
    shown.path = [at = wand, middle_s](double time_s) { return MovedBy(at, time_s - middle_s); };
  };
  std::optional<EventRenderer> second;
  if (options.with_wand) {
    auto wand = DrawWand(options, seed);
    if (!wand.has_value()) return result;
    if (options.at_border) MoveToBorder(options, &*wand);
    add_wand(*wand);
    path = wands[0].path;
    if (options.hide_one) {
      wands[0].hidden = seed % options.target.marker_positions_m.size();
      wands[0].hidden_from_s = middle_s;
    }
  }
  if (options.second_wand) {
    const auto wand = DrawWand(options, seed + kSecondWand);
    if (!wand.has_value()) return result;
    add_wand(CrossingAt(options, wands[0].path(middle_s).value(), *wand));
    EventRenderOptions quiet = sensor;
    quiet.background_hz = quiet.shot_hz = quiet.leak_hz = quiet.hot_pixels = 0;
    quiet.bars = quiet.lamps = 0;
    quiet.led_phase = RandomStream{seed, 0x2ed}.Uniform();
    auto other = EventRenderer::Create(*options.camera.intrinsics, options.camera.image_size_px,
                                       options.target, scene, quiet);
    result.status = other.status();
    if (!other.ok()) return result;
    second.emplace(*std::move(other));
  }
  std::optional<TextbookChain> textbook;
  if (options.textbook) {
    textbook.emplace(options.filter.geometry, options.filter.blink_hz.front(),
                     options.filter.band_rel);
  }
  testing::EventDisturbance disturbance = options.disturbance;
  disturbance.seed = static_cast<uint32_t>(seed);
  Chain chain(&*renderer, &*filter, &*detector, textbook ? &*textbook : nullptr,
              options.filter.geometry, second ? &*second : nullptr, wands, disturbance);
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
    VerifyWand(options, *renderer, wands, detection, &result.wands);
  }
  result.counts = detector->counts();
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
