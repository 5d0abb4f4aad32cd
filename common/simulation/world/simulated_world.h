// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/board/board.h"
#include "common/camera/camera_description.h"
#include "common/geometry/rigid_transform.h"
#include "common/simulation/world/simulation_options.h"
#include "common/simulation/world/wand_trajectory.h"
#include "common/target/observation.h"
#include "common/target/target.h"

namespace rigcal {

// Ground truth of one simulated camera.
struct SimulatedCamera {
  CameraDescription description;  // named "sim_0", "sim_1", ..., as given to the solver
  Intrinsics true_intrinsics;     // those described, unless the options draw them away
  RigidTransform cam_from_rig;    // frame `rig` of the world: z up, metres
  double time_offset_s = 0;
  double time_rate_ppm = 0;
  // Its clock shows clock_origin_ns more than the camera time of `Clock`; 10 s for all cameras
  // without clock_samples.
  int64_t clock_origin_ns = 0;
  // Rolling shutter: a marker in image row y is seen line_delay_s * (y - (height - 1) / 2) after
  // the frame's time.
  double line_delay_s = 0;
  double rate_hz = 0;
  double outlier_share = 0;
  double phase_s = 0;  // rig time of the first frame
};

// Pose of the wand: x_in_rig of a point at `s` metres along it is origin_m + s * direction. Of a
// point x of a rigid target it is origin_m + rotation * x.
struct WandPose {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;                                         // unit
  Eigen::Quaternion<double, Eigen::DontAlign> rotation{1, 0, 0, 0};  // rig_from_target

  Eigen::Vector3d At(double position_m) const { return origin_m + position_m * direction; }
};

// The image of a point in frame `cam`. False where the lens has none: also beyond the part of the
// field in which its model is one to one, where a point would come back into the picture at a wrong
// place.
bool ImageOf(const Intrinsics& intrinsics, const Eigen::Vector3d& x_in_cam, Eigen::Vector2d* pixel);

// A rig of cameras around a volume and a wand waved in it: what agents simulate, tests use and the
// CLI compares with. Deterministic: the same options and target give the same observations in every
// process.
class SimulatedWorld {
 public:
  static absl::StatusOr<SimulatedWorld> Create(const SimulationOptions& options,
                                               const Target& target);

  const SimulationOptions& options() const { return options_; }
  const Target& target() const { return target_; }  // as given to the solver
  // With its errors of length; static points where they are in the world.
  const Target& true_target() const { return true_target_; }
  const std::vector<SimulatedCamera>& cameras() const { return cameras_; }

  // Smooth, with continuous acceleration.
  WandPose WandAt(double rig_time_s) const;
  // x_in_rig of a marker of the true target. Every camera sees it from all sides, but of a board
  // with two sides those of the side that faces it.
  Eigen::Vector3d MarkerAt(const WandPose& wand, size_t marker) const;

  // Frames of a camera, in capture order.
  int FrameCount(int camera) const;
  // Frame `index` of a camera: noisy, with outliers, dropouts and flipped labels; empty where the
  // wand is outside the image. `is_outlier`, if given, says which markers were put anywhere.
  Observation Observe(int camera, int index, std::vector<bool>* is_outlier = nullptr) const;
  // The same with the wand at a place of the caller's choice.
  Observation ObserveWand(int camera, int index, const WandPose& wand,
                          std::vector<bool>* is_outlier = nullptr) const;
  // Rig time at which frame `index` was truly taken.
  double FrameRigTime(int camera, int index) const;
  // A reading of the camera's clock beside the frame; the host's UTC is the rig time.
  ClockSample SampleClock(int camera, int index) const;

 private:
  SimulatedWorld() = default;
  // The wand so long after the frame's time.
  using MovingWand = std::function<WandPose(double delay_s)>;
  Observation ObserveMoving(int camera, int index, const MovingWand& wand_after,
                            std::vector<bool>* is_outlier) const;
  // Of a marker of the true target, at the time of the row it is in. False: it has no image.
  bool ImageOfMarker(const SimulatedCamera& camera, const MovingWand& wand_after, size_t marker,
                     Eigen::Vector2d* pixel) const;
  // Of a marker of `two_sided_`: it is on the side that the camera does not see.
  bool IsHidden(const SimulatedCamera& camera, const WandPose& wand, size_t marker) const;
  size_t MarkerCount() const { return static_cast<size_t>(true_target_.marker_count()); }
  bool ShowsSecondWand(int camera, int index) const;

  SimulationOptions options_;
  Target target_;
  Target true_target_;
  std::optional<Board> two_sided_;  // the target, where it is such a board
  std::vector<SimulatedCamera> cameras_;
  WandTrajectory trajectory_;
};

}  // namespace rigcal
