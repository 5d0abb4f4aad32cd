// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_recording.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"
#include "tests/accuracy/paper/paper_scene.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kNoisePurpose = 0x70617065726e;
constexpr uint64_t kMissedPurpose = 0x70617065726d;
constexpr double kMissedShare = 0.02;  // of views: wands found by event cameras, docs/accuracy.md

class Recorder {
 public:
  Recorder(const PaperRecordingOptions& options, PaperTarget target, const PaperScene& scene)
      : options_(options), target_(target), scene_(scene) {}

  // What a camera sees of the target at its frame.
  Observation See(int camera, int frame) const {
    const WandPose pose = scene_.PoseAt(scene_.TimeS(camera, frame));
    // A bumped camera sees what the others see as if that, not the camera, had moved.
    const RigidTransform& cam_from_rig =
        scene_.world().cameras()[static_cast<size_t>(camera)].cam_from_rig;
    const RigidTransform shown_from_rig = cam_from_rig.Inverse() * scene_.CamFromRig(camera);
    WandPose shown = pose;
    shown.origin_m = shown_from_rig * pose.origin_m;
    shown.direction = shown_from_rig.rotation * pose.direction;
    shown.rotation = Eigen::Quaterniond(shown_from_rig.rotation) * pose.rotation;
    Observation row = scene_.world().ObserveWand(camera, frame, shown);
    RandomStream missed{options_.seed, kMissedPurpose, Motion(), static_cast<uint64_t>(camera),
                        static_cast<uint64_t>(frame)};
    bool seen = missed.Uniform() >= kMissedShare && Faces(camera, pose);
    const bool is_event = PaperScene::IsEventCamera(camera);
    const double height = scene_.DescriptionOf(camera).image_size_px.height;
    const double sigma_px = SigmaPx(camera);
    for (size_t m = 0; m < row.markers.size(); ++m) {
      MarkerObservation& marker = row.markers[m];
      if (is_event) {
        marker.centre_px.y() -= scene_.FirstRow(camera);
        marker.visible &= marker.centre_px.y() >= 0 && marker.centre_px.y() <= height - 1;
      }
      marker.centre_px += NoisePx(camera, frame, m);
      marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    }
    // These boards are found whole or not at all.
    if (scene_.IsBoard()) seen &= row.VisibleCount() == static_cast<int>(row.markers.size());
    if (!seen) row.markers.assign(row.markers.size(), MarkerObservation());
    return row;
  }

  // What See adds to a centre.
  Eigen::Vector2d NoisePx(int camera, int frame, size_t marker) const {
    RandomStream random{options_.seed,
                        kNoisePurpose,
                        Motion(),
                        static_cast<uint64_t>(camera),
                        static_cast<uint64_t>(frame),
                        marker};
    const double x = random.Gaussian(), y = random.Gaussian();
    return SigmaPx(camera) * Eigen::Vector2d(x, y);
  }

 private:
  // Tells the noise of one motion from that of another.
  uint64_t Motion() const { return static_cast<uint64_t>(scene_.motion()); }

  double SigmaPx(int camera) const {
    const PaperNoise noise = NoiseOf(options_.boards_noisy_as_wand ? PaperTarget::kWand : target_);
    return PaperScene::IsEventCamera(camera) ? noise.event_px : noise.frame_px;
  }

  bool Faces(int camera, const WandPose& pose) const {
    return scene_.FacingCosine(camera, pose) >=
           std::cos(options_.board_angle_deg * std::numbers::pi / 180);
  }

  const PaperRecordingOptions& options_;
  const PaperTarget target_;
  const PaperScene& scene_;
};

}  // namespace

PaperNoise NoiseOf(PaperTarget target) {
  switch (target) {
    case PaperTarget::kWand:
      // docs/detection.md, office, 1 ms exposures, 1.5 m/s; docs/accuracy.md, event cameras,
      // moving.
      return {0.056, 0.074};
    case PaperTarget::kCircles:
      // docs/accuracy.md, printed boards, tilted by 45 degrees; boards before event cameras, a
      // print: the middle of 0.32 and 0.38, without the shift that all circles have in common.
      return {0.015, 0.35};
    case PaperTarget::kChecker:
      // The same; nothing is measured of checkers before event cameras: that of circles.
      return {0.013, 0.35};
  }
  return {};
}

int BoardFrameStep(const PaperRecordingOptions& options) {
  return std::max(1, static_cast<int>(std::lround(kPaperTriggerHz / options.board_rate_hz)));
}

int ViewCount(const std::vector<Observation>& rows) {
  return static_cast<int>(
      std::ranges::count_if(rows, [](const Observation& row) { return row.VisibleCount() > 0; }));
}

absl::Status RecordPaperPath(const PaperRecordingOptions& options, PaperRecording* recording) {
  RIGCAL_ASSIGN_OR_RETURN(const PaperScene scene,
                          PaperScene::Create(options, PaperTarget::kWand, PaperMotion::kPath));
  const Recorder recorder(options, PaperTarget::kWand, scene);
  for (int c = 0; c < kPaperCameras; ++c) {
    CameraRows& rows = recording->marker.emplace_back();
    CameraRows& exact_rows = recording->exact_marker.emplace_back();
    rows.camera = exact_rows.camera = scene.DescriptionOf(c).camera;
    for (int frame = 0; frame < scene.FrameCount(); ++frame) {
      Observation row = recorder.See(c, frame);
      row.markers = {row.markers[kPaperPathMarker]};
      Observation exact_row = row;
      exact_row.markers[0].centre_px -= recorder.NoisePx(c, frame, kPaperPathMarker);
      rows.rows.push_back(std::move(row));
      exact_rows.rows.push_back(std::move(exact_row));
    }
  }
  recording->true_rig = scene.TrueRig();
  recording->path = scene.MarkerPath();
  return absl::OkStatus();
}

absl::StatusOr<PaperRecording> RecordPaper(const PaperRecordingOptions& options,
                                           PaperTarget target) {
  PaperRecording recording;
  RIGCAL_ASSIGN_OR_RETURN(const PaperScene scene,
                          PaperScene::Create(options, target, PaperMotion::kWave));
  recording.input.target = scene.target();
  const Recorder recorder(options, target, scene);
  for (int c = 0; c < kPaperCameras; ++c) {
    server::CameraTrack& track = recording.input.tracks.emplace_back();
    track.session_id = "wave";
    track.camera = scene.DescriptionOf(c);
    const int step = scene.IsBoard() ? BoardFrameStep(options) : 1;
    for (int frame = 0; frame < scene.FrameCount(); frame += step) {
      track.observations.push_back(recorder.See(c, frame));
    }
    recording.views.emplace_back(track.camera.camera, ViewCount(track.observations));
    if (recording.views.back().second < kPaperLeastViews) recording.input.tracks.pop_back();
  }
  RIGCAL_RETURN_IF_ERROR(RecordPaperPath(options, &recording));
  return recording;
}

}  // namespace rigcal::accuracy
