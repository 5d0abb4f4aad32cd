// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/paper/paper_scene.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/board/board.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_rig.h"
#include "common/status/status_macros.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kPathPurpose = 0x706170657270;
// How a board swings up and down and about its normal.
constexpr double kBoardSwingRad = 0.6;
constexpr double kPitchPeriodS = 3.1, kRollPeriodS = 4.3;
constexpr uint32_t kEventRows = 720;
constexpr double kReferenceHz = 200;
constexpr double kReferenceMarginS = 0.5;  // before and after the path

absl::StatusOr<Target> MakeTarget(PaperTarget kind) {
  if (kind == PaperTarget::kWand) return ParseTarget("wand:0,0.13,0.39;diameter=0.04;hz=500");
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(BoardTextOf(kind)));
  return MakeBoardTarget(board);
}

SimulationOptions WorldOptions(const PaperRecordingOptions& options, PaperTarget target) {
  SimulationOptions world;
  world.seed = options.seed;
  world.camera_count = kPaperCameras;
  world.duration_s = options.duration_s;
  world.rate_hz = kPaperTriggerHz;
  world.noise_px = world.outlier_share = world.dropout_share = 0;  // see who records
  world.length_sigma_m =
      target == PaperTarget::kWand ? options.wand_sigma_m : options.board_sigma_m;
  return world;
}

}  // namespace

// Both fit on a sheet of A2.
std::string BoardTextOf(PaperTarget target) {
  switch (target) {
    case PaperTarget::kWand:
      break;
    case PaperTarget::kCircles:
      return "board:circles,4x11,0.045";
    case PaperTarget::kChecker:
      return "board:checker,9x6,0.06";
  }
  return "";
}

absl::StatusOr<PaperScene> PaperScene::Create(const PaperRecordingOptions& options,
                                              PaperTarget target, PaperMotion motion) {
  PaperRecordingOptions its_options = options;
  if (motion == PaperMotion::kPath) {  // of a wand that is exactly as long as it is said to be
    its_options.duration_s = options.path_s;
    its_options.wand_sigma_m = 0;
    target = PaperTarget::kWand;
  }
  RIGCAL_ASSIGN_OR_RETURN(Target given, MakeTarget(target));
  Target shown = given;
  shown.board.clear();  // points that are off are not those of a printed board
  RIGCAL_ASSIGN_OR_RETURN(SimulatedWorld world,
                          SimulatedWorld::Create(WorldOptions(its_options, target), shown));
  return PaperScene(its_options, target, motion, std::move(given), std::move(world));
}

PaperScene::PaperScene(const PaperRecordingOptions& options, PaperTarget target, PaperMotion motion,
                       Target given, SimulatedWorld world)
    : options_(options),
      motion_(motion),
      is_board_(target != PaperTarget::kWand),
      target_(std::move(given)),
      world_(std::move(world)) {
  if (motion != PaperMotion::kPath) return;
  RandomStream other_seed{options.seed, kPathPurpose};
  path_ = WandTrajectory(static_cast<uint32_t>(other_seed.Bits()), MakeWaveVolume(world_.options()),
                         options.path_s, world_.options().max_speed_m_s);
}

double PaperScene::FirstRow(int camera) const {
  const SimulatedCamera& simulated = world_.cameras()[static_cast<size_t>(camera)];
  return 0.5 * (simulated.description.image_size_px.height - kEventRows);
}

CameraDescription PaperScene::DescriptionOf(int camera) const {
  CameraDescription description = world_.cameras()[static_cast<size_t>(camera)].description;
  description.camera = IsEventCamera(camera) ? absl::StrCat("event_", camera - kPaperFrameCameras)
                                             : absl::StrCat("frame_", camera);
  description.clock.clock_id = description.camera;
  if (!IsEventCamera(camera)) return description;
  description.sensor = SensorKind::kEvent;
  description.image_size_px.height = kEventRows;
  description.intrinsics->cy_px -= FirstRow(camera);
  return description;
}

// bumped_from_cam. Of frame_1 alone.
RigidTransform PaperScene::Bump(int camera) const {
  if (camera != 1 || motion_ != PaperMotion::kPath) return {};
  return {Eigen::Quaterniond(Eigen::AngleAxisd(options_.bump_rad, Eigen::Vector3d::UnitY())),
          Eigen::Vector3d(options_.bump_m, 0, 0)};
}

RigidTransform PaperScene::CamFromRig(int camera) const {
  return Bump(camera) * world_.cameras()[static_cast<size_t>(camera)].cam_from_rig;
}

double PaperScene::TimeS(int camera, int frame) const {
  return world_.FrameRigTime(camera, frame) - (camera == 0 ? options_.first_camera_early_s : 0);
}

WandPose PaperScene::PoseAt(double time_s) const {
  if (motion_ == PaperMotion::kPath) return {path_.Middle(time_s), path_.Direction(time_s)};
  const WandPose waved = world_.WandAt(time_s);
  if (!is_board_) return waved;
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

Eigen::Vector3d PaperScene::MiddleM(const WandPose& pose) const {
  const size_t last = static_cast<size_t>(world_.true_target().marker_count()) - 1;
  return 0.5 * (world_.MarkerAt(pose, 0) + world_.MarkerAt(pose, last));
}

// z of a board points away from who looks at its pattern (board.h).
double PaperScene::FacingCosine(int camera, const WandPose& pose) const {
  if (!is_board_) return 1;
  const Eigen::Vector3d to_camera =
      (CamFromRig(camera).SourceFromTargetTranslation() - MiddleM(pose)).normalized();
  return (Eigen::Quaterniond(pose.rotation) * -Eigen::Vector3d::UnitZ()).dot(to_camera);
}

ReferencePath PaperScene::MarkerPath() const {
  ReferencePath path;
  path.rate_hz = kReferenceHz;
  const int count =
      static_cast<int>(std::lround((options_.path_s + 2 * kReferenceMarginS) * kReferenceHz));
  for (int i = 0; i <= count; ++i) {
    path.positions_m.push_back(
        world_.MarkerAt(PoseAt(i / kReferenceHz - kReferenceMarginS), kPaperPathMarker));
  }
  return path;
}

CalibrationResult PaperScene::TrueRig() const {
  CalibrationResult rig;
  rig.scale_known = true;
  for (int c = 0; c < kPaperCameras; ++c) {
    const CameraDescription description = DescriptionOf(c);
    CalibratedCamera& camera = rig.cameras.emplace_back();
    camera.camera = camera.clock_id = description.camera;
    camera.image_size_px = description.image_size_px;
    camera.intrinsics = *description.intrinsics;
    camera.cam_from_rig = CamFromRig(c);
    camera.time_offset_s = c == 0 ? -options_.first_camera_early_s : 0;
  }
  return rig;
}

}  // namespace rigcal::accuracy
