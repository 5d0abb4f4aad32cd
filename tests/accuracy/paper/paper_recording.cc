// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_recording.h"

#include <algorithm>
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
// How a board swings up and down and about its normal.
constexpr double kBoardSwingRad = 0.6;
constexpr double kPitchPeriodS = 3.1, kRollPeriodS = 4.3;
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

  // The target as it is waved, where this camera looks at it. A camera that is early was exposed
  // before the others, though its stamps do not say so.
  WandPose WavedPose(int camera, int frame) const {
    const double time_s = TimeS(camera, frame);
    const WandPose waved = world_.WandAt(time_s);
    if (!IsBoard()) return waved;
    const auto swing = [time_s](double period_s) {
      return kBoardSwingRad * std::sin(2 * std::numbers::pi * time_s / period_s);
    };
    // At rest the pattern is upright and -z of the board, its front, is x of the rig.
    Eigen::Matrix3d rest;
    rest.col(1) = -Eigen::Vector3d::UnitZ();
    rest.col(2) = -Eigen::Vector3d::UnitX();
    rest.col(0) = rest.col(1).cross(rest.col(2));
    WandPose held = waved;
    held.rotation = Eigen::AngleAxisd(2 * std::numbers::pi * time_s / options_.board_turn_s,
                                      Eigen::Vector3d::UnitZ()) *
                    Eigen::Quaterniond(rest) *
                    Eigen::AngleAxisd(swing(kPitchPeriodS), Eigen::Vector3d::UnitX()) *
                    Eigen::AngleAxisd(swing(kRollPeriodS), Eigen::Vector3d::UnitZ());
    held.direction = held.rotation * Eigen::Vector3d::UnitX();
    held.origin_m += MiddleM(waved) - MiddleM(held);
    return held;
  }

  // Rig time at which a frame was exposed.
  double TimeS(int camera, int frame) const {
    return world_.FrameRigTime(camera, frame) - (camera == 0 ? options_.first_camera_early_s : 0);
  }

  // `motion`: tells the noise of one motion from that of another.
  Observation See(int camera, int frame, const WandPose& pose, uint64_t motion) const {
    const SimulatedCamera& simulated = world_.cameras()[static_cast<size_t>(camera)];
    Observation row = world_.ObserveWand(camera, frame, pose);
    const uint64_t key[3] = {motion, static_cast<uint64_t>(camera), static_cast<uint64_t>(frame)};
    RandomStream missed{options_.seed, kMissedPurpose, key[0], key[1], key[2]};
    bool seen = missed.Uniform() >= kMissedShare && Faces(simulated, pose);
    const double sigma_px = SigmaPx(camera);
    for (size_t m = 0; m < row.markers.size(); ++m) {
      MarkerObservation& marker = row.markers[m];
      if (IsEventCamera(camera)) {
        marker.centre_px.y() -= FirstRow(simulated);
        marker.visible &= marker.centre_px.y() >= 0 && marker.centre_px.y() <= kEventRows - 1.0;
      }
      marker.centre_px += NoisePx(camera, frame, m, motion);
      marker.covariance_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    }
    // These boards are found whole or not at all.
    if (IsBoard()) seen &= row.VisibleCount() == static_cast<int>(row.markers.size());
    if (!seen) row.markers.assign(row.markers.size(), MarkerObservation());
    return row;
  }

  // What See adds to a centre.
  Eigen::Vector2d NoisePx(int camera, int frame, size_t marker, uint64_t motion) const {
    RandomStream random{options_.seed,
                        kNoisePurpose,
                        motion,
                        static_cast<uint64_t>(camera),
                        static_cast<uint64_t>(frame),
                        marker};
    const double x = random.Gaussian(), y = random.Gaussian();
    return SigmaPx(camera) * Eigen::Vector2d(x, y);
  }

  // Of so many frames of the trigger one is used.
  int FrameStep() const {
    return IsBoard()
               ? std::max(1,
                          static_cast<int>(std::lround(kPaperTriggerHz / options_.board_rate_hz)))
               : 1;
  }

 private:
  bool IsBoard() const { return target_ != PaperTarget::kWand; }

  double SigmaPx(int camera) const {
    const PaperNoise noise = NoiseOf(options_.boards_noisy_as_wand ? PaperTarget::kWand : target_);
    return IsEventCamera(camera) ? noise.event_px : noise.frame_px;
  }

  Eigen::Vector3d MiddleM(const WandPose& pose) const {
    const size_t last = static_cast<size_t>(world_.true_target().marker_count()) - 1;
    return 0.5 * (world_.MarkerAt(pose, 0) + world_.MarkerAt(pose, last));
  }

  // z of a board points away from who looks at its pattern (board.h).
  bool Faces(const SimulatedCamera& camera, const WandPose& pose) const {
    if (!IsBoard()) return true;
    const Eigen::Vector3d to_camera =
        (camera.cam_from_rig.SourceFromTargetTranslation() - MiddleM(pose)).normalized();
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
  return world;
}

// What bumps a camera: bumped_from_cam. Of frame_1 alone.
RigidTransform BumpOf(const PaperRecordingOptions& options, int camera) {
  if (camera != 1) return {};
  return {Eigen::Quaterniond(Eigen::AngleAxisd(options.bump_rad, Eigen::Vector3d::UnitY())),
          Eigen::Vector3d(options.bump_m, 0, 0)};
}

CalibrationResult TrueRig(const PaperRecordingOptions& options, const SimulatedWorld& world) {
  CalibrationResult rig;
  rig.scale_known = true;
  for (int c = 0; c < kPaperCameras; ++c) {
    const CameraDescription description = DescriptionOf(world, c);
    CalibratedCamera& camera = rig.cameras.emplace_back();
    camera.camera = camera.clock_id = description.camera;
    camera.image_size_px = description.image_size_px;
    camera.intrinsics = *description.intrinsics;
    camera.cam_from_rig = BumpOf(options, c) * world.cameras()[static_cast<size_t>(c)].cam_from_rig;
    camera.time_offset_s = c == 0 ? -options.first_camera_early_s : 0;
  }
  return rig;
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
    const RigidTransform& cam_from_rig = world.cameras()[static_cast<size_t>(c)].cam_from_rig;
    // A bumped camera sees what the others see as if that, not the camera, had moved.
    const RigidTransform shown_from_rig =
        cam_from_rig.Inverse() * BumpOf(options, c) * cam_from_rig;
    CameraRows& rows = recording->marker.emplace_back();
    CameraRows& exact_rows = recording->exact_marker.emplace_back();
    rows.camera = exact_rows.camera = DescriptionOf(world, c).camera;
    for (int frame = 0; frame < world.FrameCount(c); ++frame) {
      WandPose shown = pose_at(recorder.TimeS(c, frame));
      shown.origin_m = shown_from_rig * shown.origin_m;
      shown.direction = shown_from_rig.rotation * shown.direction;
      Observation row = recorder.See(c, frame, shown, kPathPurpose);
      row.markers = {row.markers[kPathMarker]};
      Observation exact_row = row;
      exact_row.markers[0].centre_px -= recorder.NoisePx(c, frame, kPathMarker, kPathPurpose);
      rows.rows.push_back(std::move(row));
      exact_rows.rows.push_back(std::move(exact_row));
    }
  }
  recording->true_rig = TrueRig(options, world);
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
  Target shown = recording.input.target;
  shown.board.clear();  // points that are off are not those of a printed board
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world,
                          SimulatedWorld::Create(WorldOptions(options, target), shown));
  const Recorder recorder(options, target, world);
  for (int c = 0; c < kPaperCameras; ++c) {
    server::CameraTrack& track = recording.input.tracks.emplace_back();
    track.session_id = "wave";
    track.camera = DescriptionOf(world, c);
    for (int frame = 0; frame < world.FrameCount(c); frame += recorder.FrameStep()) {
      track.observations.push_back(recorder.See(c, frame, recorder.WavedPose(c, frame), 0));
    }
  }
  RIGCAL_RETURN_IF_ERROR(RecordPath(options, &recording));
  return recording;
}

}  // namespace rigcal::accuracy
