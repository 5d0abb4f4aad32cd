// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/simulation/frames/scene_renderer.h"
#include "common/simulation/world/simulated_world.h"

namespace rigcal {

// The frames of one camera of a simulated world: frame `index` is exposed around
// SimulatedWorld::FrameRigTime (its middle), with the wand moving along the world's trajectory and
// its true spans, seen through the camera's true lens. Within the world's gap no camera sees the
// wand. The world's noise, outliers, dropouts and swaps concern observations, not frames.
// Deterministic as SceneRenderer; frames in any order. One thread at a time.
class FrameRenderer {
 public:
  // INVALID_ARGUMENT: no such camera, or as SceneRenderer::Create.
  static absl::StatusOr<FrameRenderer> Create(std::shared_ptr<const SimulatedWorld> world,
                                              int camera, const FrameRenderOptions& options);

  size_t buffer_size() const { return scene_.buffer_size(); }

  // INVALID_ARGUMENT: `bgr` is not buffer_size() long; OUT_OF_RANGE: no such frame.
  absl::StatusOr<FrameGroundTruth> Render(int index, std::span<uint8_t> bgr);

 private:
  FrameRenderer(std::shared_ptr<const SimulatedWorld> world, int camera, SceneRenderer scene)
      : world_(std::move(world)), camera_(camera), scene_(std::move(scene)) {}
  const RigidTransform& CamFromRig() const {
    return world_->cameras()[static_cast<size_t>(camera_)].cam_from_rig;
  }
  std::vector<SphereMotion> SpheresAt(double rig_time_s) const;

  std::shared_ptr<const SimulatedWorld> world_;
  int camera_ = 0;
  SceneRenderer scene_;
};

}  // namespace rigcal
