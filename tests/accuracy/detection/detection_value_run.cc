// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "agent/detect/frame/background_learner.h"
#include "agent/detect/frame/wand_detector.h"
#include "common/simulation/frames/frame_renderer.h"
#include "common/statistics/robust_statistics.h"
#include "common/status/status_macros.h"
#include "server/solve/calibrate.h"
#include "tests/accuracy/detection/detection_value.h"
#include "tests/accuracy/detection/paper_rig.h"
#include "tests/accuracy/rig/calibration_errors.h"
#include "tests/accuracy/seed_runs.h"
#include "tests/accuracy/thread_cpu.h"

namespace rigcal::accuracy {
namespace {

// What one detector makes of one camera's frames.
struct CameraScore {
  absl::Status status;
  server::CameraTrack track;
  int frames = 0, shown = 0, views = 0, false_wands = 0, centres = 0;
  double squares_px2 = 0, nees = 0;
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  std::vector<double> milliseconds;

  void Add(const FrameGroundTruth& truth, const Observation& row) {
    ++frames;
    const auto inside = std::ranges::count_if(
        truth.markers, [](const MarkerGroundTruth& marker) { return marker.inside; });
    shown += inside >= 2 ? 1 : 0;
    if (row.VisibleCount() == 0) return;
    double worst_px = truth.markers.empty() ? 2 * kFalsePx : 0;
    for (size_t m = 0; m < truth.markers.size(); ++m) {
      if (!row.markers[m].visible) continue;
      worst_px = std::max(worst_px, (row.markers[m].centre_px - truth.markers[m].centre_px).norm());
    }
    if (worst_px > kFalsePx) {
      ++false_wands;
      return;
    }
    ++views;
    for (size_t m = 0; m < truth.markers.size(); ++m) {
      const MarkerObservation& marker = row.markers[m];
      if (!marker.visible) continue;
      const Eigen::Vector2d error_px = marker.centre_px - truth.markers[m].centre_px;
      sum_px += error_px;
      squares_px2 += error_px.squaredNorm();
      nees += error_px.dot(marker.covariance_px2.inverse() * error_px);
      ++centres;
    }
  }
};
using CameraScores = std::vector<CameraScore>;  // by variant

// One variant's detector of one camera, as an agent runs it.
class RunningDetector {
 public:
  static absl::StatusOr<RunningDetector> Create(const DetectorVariant& variant, double exposure_s,
                                                const Target& target,
                                                const CameraDescription& camera) {
    agent::WandDetectorOptions options;
    options.exposure_s = exposure_s;
    options.without = variant.without;
    RIGCAL_ASSIGN_OR_RETURN(agent::WandDetector detector,
                            agent::WandDetector::Create(options, target, camera));
    RunningDetector running(std::move(detector));
    if (!variant.background) return running;
    RIGCAL_ASSIGN_OR_RETURN(
        running.background_,
        agent::BackgroundLearner::Create(options.colour, camera.image_size_px, kBackgroundAfterS));
    running.detector_.SetBackground(running.background_->background());
    return running;
  }

  absl::StatusOr<agent::Detection> Detect(const agent::ImageView& image, int64_t time_ns) {
    if (background_) background_->Look(image);
    RIGCAL_ASSIGN_OR_RETURN(agent::Detection detection, detector_.Detect(image, time_ns, 0));
    if (background_) background_->Learn(image, detection);
    return detection;
  }

 private:
  explicit RunningDetector(agent::WandDetector detector) : detector_(std::move(detector)) {}

  agent::WandDetector detector_;
  std::optional<agent::BackgroundLearner> background_;
};

absl::StatusOr<CameraScores> RunCamera(const std::shared_ptr<const SimulatedWorld>& world,
                                       int number, const FrameRenderOptions& render,
                                       const std::vector<DetectorVariant>& variants) {
  RIGCAL_ASSIGN_OR_RETURN(FrameRenderer renderer, FrameRenderer::Create(world, number, render));
  const CameraDescription& camera = world->cameras()[static_cast<size_t>(number)].description;
  std::vector<RunningDetector> detectors;
  CameraScores scores(variants.size());
  for (size_t v = 0; v < variants.size(); ++v) {
    RIGCAL_ASSIGN_OR_RETURN(
        RunningDetector detector,
        RunningDetector::Create(variants[v], render.exposure_s, world->target(), camera));
    detectors.push_back(std::move(detector));
    scores[v].track.session_id = "wave";
    scores[v].track.camera = camera;
  }
  std::vector<uint8_t> pixels(renderer.buffer_size());
  const ImageSize size = camera.image_size_px;
  const agent::ImageView image{pixels.data(), static_cast<int>(size.width),
                               static_cast<int>(size.height),
                               static_cast<ptrdiff_t>(size.width) * 3, agent::PixelFormat::kBgr8};
  for (int i = 0; i < world->FrameCount(number); ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const FrameGroundTruth truth, renderer.Render(i, pixels));
    const int64_t time_ns = world->Observe(number, i).time_ns;
    for (size_t v = 0; v < variants.size(); ++v) {
      const double begin_s = ThreadCpuS();
      RIGCAL_ASSIGN_OR_RETURN(const agent::Detection detection,
                              detectors[v].Detect(image, time_ns));
      scores[v].milliseconds.push_back(1e3 * (ThreadCpuS() - begin_s));
      scores[v].Add(truth, detection.observation);
      scores[v].track.observations.push_back(detection.observation);
    }
  }
  return scores;
}

void Solve(const SimulatedWorld& world, std::vector<server::CameraTrack> tracks,
           DetectionValue* value) {
  const server::CalibrationOutcome outcome =
      server::Calibrate({.target = world.target(), .tracks = std::move(tracks), .refused = {}}, {});
  value->solved = outcome.result.status();
  if (!outcome.result.ok()) return;
  const auto errors = CompareWithGroundTruth(world, *outcome.result);
  value->solved = errors.status();
  if (!errors.ok()) return;
  double squares_m2 = 0;
  for (size_t c = 0; c < errors->cameras.size(); ++c) {
    const double error_m = errors->PositionErrorAtTrueLengthM(c).norm();
    value->worst_mm = std::max(value->worst_mm, 1e3 * error_m);
    squares_m2 += error_m * error_m;
  }
  value->rms_mm = 1e3 * std::sqrt(squares_m2 / static_cast<double>(errors->cameras.size() - 1));
}

DetectionValue Summarise(const SimulatedWorld& world, const DetectionValueOptions& options,
                         std::vector<CameraScore> cameras) {
  DetectionValue value;
  double squares_px2 = 0, nees = 0;
  Eigen::Vector2d sum_px = Eigen::Vector2d::Zero();
  int centres = 0;
  std::vector<double> milliseconds;
  std::vector<server::CameraTrack> tracks;
  value.views = cameras.front().views;
  for (CameraScore& camera : cameras) {
    value.frames += camera.frames;
    value.shown += camera.shown;
    value.views = std::min(value.views, camera.views);
    value.false_wands += camera.false_wands;
    squares_px2 += camera.squares_px2;
    nees += camera.nees;
    sum_px += camera.sum_px;
    centres += camera.centres;
    milliseconds.insert(milliseconds.end(), camera.milliseconds.begin(), camera.milliseconds.end());
    tracks.push_back(std::move(camera.track));
  }
  value.views_share = value.views / (options.rate_hz * options.duration_s);
  value.median_ms = InterpolatedQuantile(milliseconds, 0.5);
  value.worst_ms = *std::ranges::max_element(milliseconds);
  if (centres > 0) {
    value.rms_px = std::sqrt(squares_px2 / (2 * centres));
    value.bias_px = (sum_px / centres).norm();
    value.nees = nees / (2 * centres);
  }
  Solve(world, std::move(tracks), &value);
  return value;
}

}  // namespace

absl::StatusOr<RoomWave> MakeRoomWave(const DetectionValueOptions& options,
                                      const DetectionCase& room) {
  DetectionOptions look;
  room.change(&look);
  look.render.seed = options.seed;
  look.render.line_delay_us = 0;  // the world's shutters are global
  SimulationOptions rig;
  rig.seed = options.seed;
  rig.camera_count = options.camera_count;
  rig.rate_hz = options.rate_hz;
  rig.duration_s = options.empty_s + options.duration_s;
  rig.gap_duration_s = options.empty_s;
  RIGCAL_ASSIGN_OR_RETURN(SimulatedWorld created, SimulatedWorld::Create(rig, PaperWand()));
  return RoomWave{std::make_shared<const SimulatedWorld>(std::move(created)), look.render};
}

absl::StatusOr<std::vector<DetectionValue>> RunDetectionValue(
    const DetectionValueOptions& options, const DetectionCase& room,
    const std::vector<DetectorVariant>& variants) {
  RIGCAL_ASSIGN_OR_RETURN(const RoomWave wave, MakeRoomWave(options, room));
  struct CameraRun {
    absl::StatusOr<CameraScores> scores = absl::UnknownError("not run");
  };
  auto cameras = RunAll<CameraRun>(options.camera_count, options.threads, [&](int c) {
    return CameraRun{RunCamera(wave.world, c, wave.render, variants)};
  });
  for (const CameraRun& camera : cameras) RIGCAL_RETURN_IF_ERROR(camera.scores.status());
  std::vector<DetectionValue> values;
  for (size_t v = 0; v < variants.size(); ++v) {
    std::vector<CameraScore> scores;
    for (CameraRun& camera : cameras) scores.push_back(std::move((*camera.scores)[v]));
    values.push_back(Summarise(*wave.world, options, std::move(scores)));
  }
  return values;
}

}  // namespace rigcal::accuracy
