// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "common/calibration/calibration.h"
#include "common/simulation/world/simulated_world.h"
#include "common/simulation/world/wand_trajectory.h"
#include "tests/accuracy/paper/paper_recording.h"
#include "tests/accuracy/solver/path_comparison.h"

namespace rigcal::accuracy {

// What moves in front of the cameras.
enum class PaperMotion : uint8_t {
  kWave = 0,  // the target, to calibrate with
  kPath = 1,  // another wand, whose middle marker Table II compares with its path
};

// "board:circles,..." or "board:checker,..."; of a wand nothing.
std::string BoardTextOf(PaperTarget target);

// The rig of the eWand paper and one motion in front of it: what a recording of points and one of
// pictures have in common. Frame `rig` of SimulatedWorld, metres, seconds of rig time.
class PaperScene {
 public:
  // INVALID_ARGUMENT: options that make no world.
  static absl::StatusOr<PaperScene> Create(const PaperRecordingOptions& options, PaperTarget target,
                                           PaperMotion motion);

  const Target& target() const { return target_; }  // as given to the solver
  const SimulatedWorld& world() const { return world_; }
  PaperMotion motion() const { return motion_; }
  bool IsBoard() const { return is_board_; }
  static bool IsEventCamera(int camera) { return camera >= kPaperFrameCameras; }

  // By name, as given to the solver. The sensor of an event camera is the middle of an image of the
  // simulated world.
  CameraDescription DescriptionOf(int camera) const;
  // Row of the world's image in which an event camera's begins.
  double FirstRow(int camera) const;
  // While this motion goes on: a camera is bumped before the path, after the wave.
  RigidTransform CamFromRig(int camera) const;

  int FrameCount() const { return world_.FrameCount(0); }
  // Rig time at which a frame was exposed, its middle. A camera that is early was exposed before
  // the others, though its stamps do not say so.
  double TimeS(int camera, int frame) const;
  WandPose PoseAt(double rig_time_s) const;
  // The middle between the target's first and last point.
  Eigen::Vector3d MiddleM(const WandPose& pose) const;
  // Cosine of the angle between the front of a board and the direction to a camera; a wand: 1.
  double FacingCosine(int camera, const WandPose& pose) const;

  // Where the marker of Table II was.
  ReferencePath MarkerPath() const;
  // When the path was recorded; without residuals. Sorted by name.
  CalibrationResult TrueRig() const;

 private:
  PaperScene(const PaperRecordingOptions& options, PaperTarget target, PaperMotion motion,
             Target given, SimulatedWorld world);
  RigidTransform Bump(int camera) const;

  PaperRecordingOptions options_;
  PaperMotion motion_;
  bool is_board_;
  Target target_;
  SimulatedWorld world_;
  WandTrajectory path_;  // of the other wand
};

}  // namespace rigcal::accuracy
