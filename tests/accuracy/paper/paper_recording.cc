// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_recording.h"

#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/board/board.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_rig.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/wand_trajectory.h"
#include "common/status/status_macros.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kNoisePurpose = 0x70617065726e;
constexpr uint64_t kMissedPurpose = 0x70617065726d;
constexpr uint64_t kPathPurpose = 0x706170657270;
constexpr double kMissedShare = 0.02;  // of views: wands found by event cameras, docs/accuracy.md
constexpr uint32_t kEventRows = 720;
constexpr double kReferenceHz = 200;
constexpr double kReferenceMarginS = 0.5;  // before and after the path
constexpr size_t kPathMarker = 1;          // of the wand: its middle marker

// Both fit on a sheet of A2.
constexpr char kCircles[] = "board:circles,4x11,0.045";
constexpr char kChecker[] = "board:checker,9x6,0.06";

absl::StatusOr<Target> MakeTarget(PaperTarget kind) {
  if (kind == PaperTarget::kWand) return ParseTarget("wand:0,0.13,0.39");
  RIGCAL_ASSIGN_OR_RETURN(const Board board,
                          ParseBoard(kind == PaperTarget::kCircles ? kCircles : kChecker));
  return MakeBoardTarget(board);
}

bool IsEventCamera(int camera) { return camera >= kPaperFrameCameras; }

// The sensor of an event camera is the middle of an image of the simulated world.
double FirstRow(const SimulatedCamera& camera) {
  return 0.5 * (camera.description.image_size_px.height - kEventRows);
}

CameraDescription DescriptionOf(const SimulatedWorld& world, int camera) {
  const SimulatedCamera& simulated = world.cameras()[static_cast<size_t>(camera)];
  CameraDescription description = simulated.description;
  description.camera = IsEventCamera(camera) ? absl::StrCat("event_", camera - kPaperFrameCameras)
                                             : absl::StrCat("frame_", camera);
  description.clock.clock_id = description.camera;
  if (!IsEventCamera(camera)) return description;
  description.sensor = SensorKind::kEvent;
  description.image_size_px.height = kEventRows;
  description.intrinsics->cy_px -= FirstRow(simulated);
  return description;
}

class Recorder {
 public:
  Recorder(const PaperRecordingOptions& options, PaperTarget target, const SimulatedWorld& world)
      : options_(options), target_(target), world_(world) {}

  // `motion`: tells the noise of one motion from that of another.
  Observation See(int camera, int frame, const WandPose& pose, uint64_t motion) const {
    const SimulatedCamera& simulated = world_.cameras()[static_cast<size_t>(camera)];
    Observation row = world_.ObserveWand(camera, frame, pose);
    const uint64_t key[3] = {motion, static_cast<uint64_t>(camera), static_cast<uint64_t>(frame)};
    RandomStream missed{options_.seed, kMissedPurpose, key[0], key[1], key[2]};
    bool seen = missed.Uniform() >= kMissedShare && Faces(simulated, pose);
    const PaperNoise noise = NoiseOf(target_);
    const double sigma_px = IsEventCamera(camera) ? noise.event_px : noise.frame_px;
    for (size_t m = 0; m < row.markers.size(); ++m) {
      MarkerObservation& marker = row.markers[m];
      RandomStream random{options_.seed, kNoisePurpose, key[0], key[1], key[2], m};
      const double x_px = sigma_px * random.Gaussian(), y_px = sigma_px * random.Gaussian();
      if (IsEventCamera(camera)) {
        marker.centre_px.y() -= FirstRow(simulated);
        marker.visible &= marker.centre_px.y() >= 0 && marker.centre_px.y() <= kEventRows - 1.0;
      }
      marker.centre_px += Eigen::Vector2d(x_px, y_px);
      marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    }
    // These boards are found whole or not at all.
    if (IsBoard()) seen &= row.VisibleCount() == static_cast<int>(row.markers.size());
    if (!seen) row.markers.assign(row.markers.size(), MarkerObservation());
    return row;
  }

  // Every so manieth frame of the trigger shows the target.
  int FrameStep() const {
    return IsBoard()
               ? std::max(1,
                          static_cast<int>(std::lround(kPaperTriggerHz / options_.board_rate_hz)))
               : 1;
  }

 private:
  bool IsBoard() const { return target_ != PaperTarget::kWand; }

  // z of a board points away from who looks at its pattern (board.h).
  bool Faces(const SimulatedCamera& camera, const WandPose& pose) const {
    if (!IsBoard()) return true;
    const size_t last = static_cast<size_t>(world_.true_target().marker_count()) - 1;
    const Eigen::Vector3d middle_m = 0.5 * (world_.MarkerAt(pose, 0) + world_.MarkerAt(pose, last));
    const Eigen::Vector3d to_camera =
        (camera.cam_from_rig.SourceFromTargetTranslation() - middle_m).normalized();
    const Eigen::Vector3d front = Eigen::Quaterniond(pose.rotation) * -Eigen::Vector3d::UnitZ();
    return front.dot(to_camera) >= std::cos(options_.board_angle_deg * std::numbers::pi / 180);
  }

  const PaperRecordingOptions& options_;
  const PaperTarget target_;
  const SimulatedWorld& world_;
};

SimulationOptions WorldOptions(const PaperRecordingOptions& options, PaperTarget target) {
  SimulationOptions world;
  world.seed = options.seed;
  world.camera_count = kPaperCameras;
  world.duration_s = options.duration_s;
  world.rate_hz = kPaperTriggerHz;
  world.noise_px = world.outlier_share = world.dropout_share = 0;  // see Recorder
  world.length_sigma_m =
      target == PaperTarget::kWand ? options.wand_sigma_m : options.board_sigma_m;
  if (options.first_camera_late_s != 0) world.time_offset_s[0] = -options.first_camera_late_s;
  return world;
}

// One marker of a wand that is exactly as long as it is said to be.
absl::Status RecordPath(const PaperRecordingOptions& options, PaperRecording* recording) {
  PaperRecordingOptions exact = options;
  exact.wand_sigma_m = 0;
  exact.duration_s = options.path_s;
  RIGCAL_ASSIGN_OR_RETURN(const Target wand, MakeTarget(PaperTarget::kWand));
  const SimulationOptions world_options = WorldOptions(exact, PaperTarget::kWand);
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world, SimulatedWorld::Create(world_options, wand));
  RandomStream other_seed{options.seed, kPathPurpose};
  const WandTrajectory trajectory(static_cast<uint32_t>(other_seed.Bits()),
                                  MakeWaveVolume(world_options), options.path_s,
                                  world_options.max_speed_m_s);
  const auto pose_at = [&trajectory](double rig_time_s) {
    return WandPose{trajectory.Middle(rig_time_s), trajectory.Direction(rig_time_s)};
  };
  const Recorder recorder(exact, PaperTarget::kWand, world);
  for (int c = 0; c < kPaperCameras; ++c) {
    CameraRows& rows = recording->marker.emplace_back();
    rows.camera = DescriptionOf(world, c).camera;
    for (int frame = 0; frame < world.FrameCount(c); ++frame) {
      Observation row = recorder.See(c, frame, pose_at(world.FrameRigTime(c, frame)), kPathPurpose);
      row.markers = {row.markers[kPathMarker]};
      rows.rows.push_back(std::move(row));
    }
  }
  recording->path.rate_hz = kReferenceHz;
  const int count =
      static_cast<int>(std::lround((options.path_s + 2 * kReferenceMarginS) * kReferenceHz));
  for (int i = 0; i <= count; ++i) {
    recording->path.positions_m.push_back(
        world.MarkerAt(pose_at(i / kReferenceHz - kReferenceMarginS), kPathMarker));
  }
  return absl::OkStatus();
}

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

absl::StatusOr<PaperRecording> RecordPaper(const PaperRecordingOptions& options,
                                           PaperTarget target) {
  PaperRecording recording;
  RIGCAL_ASSIGN_OR_RETURN(recording.input.target, MakeTarget(target));
  RIGCAL_ASSIGN_OR_RETURN(
      const SimulatedWorld world,
      SimulatedWorld::Create(WorldOptions(options, target), recording.input.target));
  const Recorder recorder(options, target, world);
  for (int c = 0; c < kPaperCameras; ++c) {
    server::CameraTrack& track = recording.input.tracks.emplace_back();
    track.session_id = "wave";
    track.camera = DescriptionOf(world, c);
    for (int frame = 0; frame < world.FrameCount(c); frame += recorder.FrameStep()) {
      track.observations.push_back(
          recorder.See(c, frame, world.WandAt(world.FrameRigTime(c, frame)), 0));
    }
  }
  RIGCAL_RETURN_IF_ERROR(RecordPath(options, &recording));
  return recording;
}

}  // namespace rigcal::accuracy
