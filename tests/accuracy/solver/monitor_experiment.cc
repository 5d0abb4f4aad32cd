// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/solver/monitor_experiment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/camera/camera_model.h"
#include "common/simulation/world/random_stream.h"
#include "common/simulation/world/simulated_world.h"
#include "common/status/status_macros.h"
#include "server/solve/evaluate/pose_covariance.h"
#include "tests/accuracy/rig/simulated_tracks.h"
#include "tests/accuracy/solver/halves_experiment.h"
#include "tests/server/solve/simulated_input.h"

namespace rigcal::accuracy {
namespace {

constexpr uint64_t kBumpPurpose = 0x62756d70;

Target Wand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  return target;
}

// One wave of one rig: the calibration, the look, and a calibration after the bump.
absl::StatusOr<SimulatedWorld> WorldOf(const MonitorOptions& options, uint32_t seed) {
  SimulationOptions simulation;
  simulation.seed = seed;
  simulation.camera_count = options.camera_count;
  simulation.duration_s = 2 * options.duration_s + options.look_s;
  return SimulatedWorld::Create(simulation, Wand());
}

// The rows from one time to another; those of a bumped camera as it is then.
server::CalibrationInput Part(const SimulatedWorld& world, double from_s, double to_s) {
  server::CalibrationInput input = server::InputOf(world);
  for (size_t c = 0; c < input.tracks.size(); ++c) {
    std::vector<Observation> rows;
    for (size_t i = 0; i < input.tracks[c].observations.size(); ++i) {
      const double at_s = world.FrameRigTime(static_cast<int>(c), static_cast<int>(i));
      if (at_s >= from_s && at_s < to_s) rows.push_back(input.tracks[c].observations[i]);
    }
    input.tracks[c].observations = std::move(rows);
  }
  return input;
}

// Turned about its centre, in its own axes, and moved in the rig.
RigidTransform Bumped(const RigidTransform& pose, const Eigen::Vector3d& turn_rad,
                      const Eigen::Vector3d& shift_m) {
  RigidTransform bump;
  if (turn_rad.norm() > 0) {
    bump.rotation = Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized());
  }
  RigidTransform moved = bump * pose;
  moved.translation_m -= moved.rotation * shift_m;
  return moved;
}

struct Bump {
  int camera = 0;
  RigidTransform pose;
};

// The part as above, the markers of the bumped camera moved by what the bump makes of their images.
server::CalibrationInput BumpedPart(const SimulatedWorld& world, double from_s, double to_s,
                                    const Bump& bump) {
  server::CalibrationInput input = server::InputOf(world);
  const SimulatedCamera& true_camera = world.cameras()[static_cast<size_t>(bump.camera)];
  server::CameraTrack& track = input.tracks[static_cast<size_t>(bump.camera)];
  std::map<int64_t, Observation> moved;
  for (size_t i = 0; i < track.observations.size(); ++i) {
    Observation& row = track.observations[i];
    const WandPose wand = world.WandAt(world.FrameRigTime(bump.camera, static_cast<int>(i)));
    for (size_t m = 0; m < row.markers.size(); ++m) {
      const Eigen::Vector3d point_m = world.MarkerAt(wand, m);
      Eigen::Vector2d before, after;
      if (!row.markers[m].visible ||
          !ImageOf(true_camera.true_intrinsics, true_camera.cam_from_rig * point_m, &before) ||
          !ImageOf(true_camera.true_intrinsics, bump.pose * point_m, &after)) {
        continue;
      }
      row.markers[m].centre_px += after - before;
    }
    moved[row.time_ns] = row;
  }
  server::CalibrationInput part = Part(world, from_s, to_s);
  for (Observation& row : part.tracks[static_cast<size_t>(bump.camera)].observations) {
    row = moved.at(row.time_ns);
  }
  return part;
}

// Of one camera's centre against the others', which are aligned with the truth.
double ErrorAgainstOthersM(const CalibrationResult& result,
                           const std::vector<RigidTransform>& truth, size_t camera) {
  const auto count = static_cast<Eigen::Index>(truth.size() - 1);
  Eigen::Matrix3Xd estimated(3, count), right(3, count);
  Eigen::Index next = 0;
  for (size_t c = 0; c < truth.size(); ++c) {
    if (c == camera) continue;
    estimated.col(next) = result.cameras[c].cam_from_rig.SourceFromTargetTranslation();
    right.col(next++) = truth[c].SourceFromTargetTranslation();
  }
  const Eigen::Matrix4d aligned = Eigen::umeyama(estimated, right, /*with_scaling=*/false);
  const Eigen::Vector3d centre_m =
      result.cameras[camera].cam_from_rig.SourceFromTargetTranslation();
  return (aligned.topLeftCorner<3, 3>() * centre_m + aligned.topRightCorner<3, 1>() -
          truth[camera].SourceFromTargetTranslation())
      .norm();
}

absl::Status RunBump(const MonitorOptions& options, const SimulatedWorld& world,
                     const CalibrationResult& active, const Bump& bump, BumpOutcome* outcome) {
  const auto camera = static_cast<size_t>(bump.camera);
  const double look_s = options.duration_s, end_s = look_s + options.look_s;
  outcome->camera = active.cameras[camera].camera;
  server::CalibrationInput input = BumpedPart(world, look_s, end_s, bump);
  const server::CalibrationOutcome now = server::Calibrate(input, server::LookOptions(active));
  RIGCAL_RETURN_IF_ERROR(now.result.status());
  RIGCAL_ASSIGN_OR_RETURN(const server::RigDifference difference,
                          server::CompareRigs(active, *now.result));
  outcome->moved = difference.Moved();
  outcome->problem = difference.problem;
  outcome->sigmas = difference.cameras[camera].sigmas;

  input.parent = active;
  const server::CalibrationOutcome repaired =
      server::Calibrate(input, RepairOptions(outcome->camera));
  if (!repaired.result.ok()) {
    outcome->problem = std::string(repaired.result.status().message());
    return absl::OkStatus();
  }
  outcome->repaired = true;
  outcome->good = repaired.result->quality.grade == QualityGrade::kGood;
  std::vector<RigidTransform> truth;
  for (const SimulatedCamera& each : world.cameras()) truth.push_back(each.cam_from_rig);
  truth[camera] = bump.pose;
  outcome->repaired_error_m = ErrorAgainstOthersM(*repaired.result, truth, camera);
  for (size_t c = 0; c < truth.size(); ++c) {
    if (c == camera) continue;
    outcome->others_moved_m =
        std::max(outcome->others_moved_m,
                 (repaired.result->cameras[c].cam_from_rig.SourceFromTargetTranslation() -
                  active.cameras[c].cam_from_rig.SourceFromTargetTranslation())
                     .norm());
  }
  input.parent.reset();
  const server::CalibrationOutcome same = server::Calibrate(input, CalibrationOptions());
  RIGCAL_RETURN_IF_ERROR(same.result.status());
  outcome->same_rows_error_m = ErrorAgainstOthersM(*same.result, truth, camera);
  const server::CalibrationOutcome whole = server::Calibrate(
      BumpedPart(world, end_s, end_s + options.duration_s, bump), CalibrationOptions());
  RIGCAL_RETURN_IF_ERROR(whole.result.status());
  outcome->full_error_m = ErrorAgainstOthersM(*whole.result, truth, camera);
  return absl::OkStatus();
}

absl::Status RunTrial(const MonitorOptions& options, uint32_t seed, MonitorTrial* trial) {
  RIGCAL_ASSIGN_OR_RETURN(const SimulatedWorld world, WorldOf(options, seed));
  const double look_s = options.duration_s;
  const server::CalibrationOutcome active =
      server::Calibrate(Part(world, 0, look_s), CalibrationOptions());
  RIGCAL_RETURN_IF_ERROR(active.result.status());
  const server::CalibrationOutcome quiet = server::Calibrate(
      Part(world, look_s, look_s + options.look_s), server::LookOptions(*active.result));
  RIGCAL_RETURN_IF_ERROR(quiet.result.status());
  RIGCAL_ASSIGN_OR_RETURN(const server::RigDifference difference,
                          server::CompareRigs(*active.result, *quiet.result));
  trial->quiet_moved = difference.Moved();
  trial->quiet_problem = difference.problem;
  if (!options.bumps) return absl::OkStatus();

  RandomStream random{seed, kBumpPurpose};
  const auto direction = [&random] {
    return Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian()).normalized();
  };
  const int camera = static_cast<int>(seed % static_cast<uint32_t>(options.camera_count));
  const RigidTransform& pose = world.cameras()[static_cast<size_t>(camera)].cam_from_rig;
  const Eigen::Vector3d turn_rad = options.turn_rad * direction();
  const Eigen::Vector3d shift_m = options.shift_m * direction();
  RIGCAL_RETURN_IF_ERROR(RunBump(options, world, *active.result,
                                 {camera, Bumped(pose, turn_rad, Eigen::Vector3d::Zero())},
                                 &trial->turn));
  return RunBump(options, world, *active.result,
                 {camera, Bumped(pose, Eigen::Vector3d::Zero(), shift_m)}, &trial->shift);
}

}  // namespace

CalibrationOptions RepairOptions(const std::string& camera) {
  CalibrationOptions options;
  options.kind = SolveKind::kRepair;
  options.parent_id = "active";
  options.only_cameras = {camera};
  return options;
}

namespace {

absl::Status RunRecordingHalves(const server::CalibrationInput& recording, size_t camera,
                                const Eigen::Vector3d& turn_rad, RecordingTrial* trial) {
  const PartsOptions halves{.count = 2};
  const server::CalibrationOutcome first =
      server::Calibrate(TakePart(recording, halves, 0), CalibrationOptions());
  RIGCAL_RETURN_IF_ERROR(first.result.status());
  server::CalibrationInput second = TakePart(recording, halves, 1);
  trial->camera = second.tracks[camera].camera.camera;
  const auto look = [&]() -> absl::StatusOr<server::RigDifference> {
    const server::CalibrationOutcome now =
        server::Calibrate(second, server::LookOptions(*first.result));
    RIGCAL_RETURN_IF_ERROR(now.result.status());
    return server::CompareRigs(*first.result, *now.result);
  };
  const auto of_camera = [&](const server::RigDifference& difference) {
    return *std::ranges::find(difference.cameras, trial->camera, &server::CameraDifference::camera);
  };
  RIGCAL_ASSIGN_OR_RETURN(const server::RigDifference quiet, look());
  trial->quiet_moved = quiet.Moved();
  trial->quiet_problem = quiet.problem;
  TurnRows(turn_rad, &second.tracks[camera]);
  RIGCAL_ASSIGN_OR_RETURN(const server::RigDifference moved, look());
  trial->moved = moved.Moved();
  trial->problem = moved.problem;
  trial->found = of_camera(moved);
  second.parent = *first.result;
  const server::CalibrationOutcome repaired =
      server::Calibrate(second, RepairOptions(trial->camera));
  if (!repaired.result.ok()) {
    trial->repair_problem = std::string(repaired.result.status().message());
    return absl::OkStatus();
  }
  trial->repaired = true;
  trial->grade = repaired.result->quality.grade;
  RIGCAL_ASSIGN_OR_RETURN(const server::RigDifference back,
                          server::CompareRigs(*first.result, *repaired.result));
  trial->back = of_camera(back);
  // In the frame that a repair keeps; a comparison would align it anew.
  for (size_t c = 0; c < repaired.result->cameras.size(); ++c) {
    const CalibratedCamera &before = first.result->cameras[c], &after = repaired.result->cameras[c];
    if (before.camera == trial->camera) continue;
    trial->others_moved_m =
        std::max(trial->others_moved_m, (after.cam_from_rig.SourceFromTargetTranslation() -
                                         before.cam_from_rig.SourceFromTargetTranslation())
                                            .norm());
  }
  return absl::OkStatus();
}

}  // namespace

RecordingTrial RunRecordingTrial(const server::CalibrationInput& recording, size_t camera,
                                 const Eigen::Vector3d& turn_rad) {
  RecordingTrial trial;
  trial.status = RunRecordingHalves(recording, camera, turn_rad, &trial);
  return trial;
}

MonitorTrial RunMonitorTrial(const MonitorOptions& options, uint32_t seed) {
  MonitorTrial trial;
  trial.status = RunTrial(options, seed, &trial);
  return trial;
}

void TurnRows(const Eigen::Vector3d& turn_rad, server::CameraTrack* track) {
  const Intrinsics& intrinsics = *track->camera.intrinsics;
  const Eigen::AngleAxisd turn(turn_rad.norm(), turn_rad.normalized());
  for (Observation& row : track->observations) {
    for (MarkerObservation& marker : row.markers) {
      if (!marker.visible) continue;
      const absl::StatusOr<Eigen::Vector2d> ray = Undistort(intrinsics, marker.centre_px);
      Eigen::Vector2d pixel;
      if (ray.ok() && Project(intrinsics, turn * ray->homogeneous(), &pixel)) {
        marker.centre_px = pixel;
      }
    }
  }
}

}  // namespace rigcal::accuracy
