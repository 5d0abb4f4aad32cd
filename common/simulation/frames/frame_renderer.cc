// SPDX-License-Identifier: Apache-2.0
#include "common/simulation/frames/frame_renderer.h"

#include "absl/strings/str_cat.h"
#include "common/simulation/world/random_stream.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr uint64_t kPixelPurpose = 0x706978656c;

}  // namespace

absl::StatusOr<FrameRenderer> FrameRenderer::Create(std::shared_ptr<const SimulatedWorld> world,
                                                    int camera, const FrameRenderOptions& options) {
  const int count = static_cast<int>(world->cameras().size());
  if (camera < 0 || camera >= count) {
    return absl::InvalidArgumentError(
        absl::StrCat("camera ", camera, " is asked for, the world has 0 to ", count - 1));
  }
  const SimulatedCamera& c = world->cameras()[static_cast<size_t>(camera)];
  // Each camera looks at another wall and has noise of its own.
  FrameRenderOptions its_options = options;
  RandomStream random{options.seed, kPixelPurpose, static_cast<uint64_t>(camera)};
  its_options.seed = static_cast<uint32_t>(random.Bits());
  RIGCAL_ASSIGN_OR_RETURN(SceneRenderer scene,
                          SceneRenderer::Create(c.true_intrinsics, c.description.image_size_px,
                                                world->true_target(), its_options));
  return FrameRenderer(std::move(world), camera, std::move(scene));
}

std::vector<SphereMotion> FrameRenderer::SpheresAt(double rig_time_s) const {
  // Differences over the exposure itself: their parabola meets the trajectory at both its ends.
  const double half_s = 0.5 * scene_.options().exposure_s;
  const WandPose before = world_->WandAt(rig_time_s - half_s);
  const WandPose now = world_->WandAt(rig_time_s);
  const WandPose after = world_->WandAt(rig_time_s + half_s);
  const RigidTransform& cam_from_rig = CamFromRig();
  std::vector<SphereMotion> spheres;
  for (const double position_m : world_->true_target().marker_positions_m) {
    const Eigen::Vector3d first = cam_from_rig * before.At(position_m);
    const Eigen::Vector3d middle = cam_from_rig * now.At(position_m);
    const Eigen::Vector3d last = cam_from_rig * after.At(position_m);
    spheres.push_back(
        {middle, (last - first) / (2 * half_s), (last - 2 * middle + first) / (half_s * half_s)});
  }
  return spheres;
}

absl::StatusOr<FrameGroundTruth> FrameRenderer::Render(int index, std::span<uint8_t> bgr) {
  if (index < 0 || index >= world_->FrameCount(camera_)) {
    return absl::OutOfRangeError(absl::StrCat("frame ", index, " of camera ", camera_,
                                              " is asked for, it has 0 to ",
                                              world_->FrameCount(camera_) - 1));
  }
  const double rig_time_s = world_->FrameRigTime(camera_, index);
  SceneFrame frame;
  frame.seed = static_cast<uint64_t>(index);
  frame.led_time_s = rig_time_s * (1 + 1e-6 * scene_.options().blink_drift_ppm);
  const RigidTransform& cam_from_rig = CamFromRig();
  const Eigen::Vector3d up = cam_from_rig.rotation * Eigen::Vector3d::UnitZ();
  frame.up = up;
  frame.floor << up, up.dot(cam_from_rig.translation_m);
  if (!world_->options().InGap(rig_time_s)) frame.spheres = SpheresAt(rig_time_s);
  return scene_.Render(frame, bgr);
}

}  // namespace rigcal
