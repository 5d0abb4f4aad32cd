// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/scene_canvas.h"
#include "common/simulation/frames/scene_ground_truth.h"
#include "common/simulation/frames/sphere_image.h"
#include "common/target/target.h"

namespace rigcal {

struct FrameGroundTruth {
  std::vector<MarkerGroundTruth> markers;  // by marker of the target; none without a wand
  std::optional<OccludingBar> bar;
};

// What changes from frame to frame.
struct SceneFrame {
  std::vector<SphereMotion> spheres;  // by marker of the target; none: the room alone
  uint64_t seed = 0;                  // of this frame's noise, occlusion and blink phase
  // Time on the LEDs' oscillator at mid exposure, s; an LED is on during the first `duty` of each
  // period. None: drawn from `seed`.
  std::optional<double> led_time_s;
  // Unit vector upwards, frame `cam`; where the overhead light comes from.
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();
  // Reflecting floor in frame `cam`, normal . x = offset: unit normal, offset_m.
  Eigen::Vector4d floor = {0, 1, 0, 1};
};

// The view of one frame camera. The room is drawn once; a frame then costs the noise and what is
// around the wand. Every sphere is imaged exactly: the ray of each pixel, through the lens model,
// against the sphere (so its image is the true ellipse, not centred on its centre's projection),
// averaged over the exposure with the LED's blinking, then the lens' blur, light, saturation and
// noise. Deterministic: equal arguments give equal frames in every process, whatever was drawn
// before. One thread at a time.
class SceneRenderer {
 public:
  // INVALID_ARGUMENT: intrinsics, image size, target or options not valid, or the options leave
  // nothing of the lens: no pixel has a ray. A target without diameter has spheres of 40 mm.
  // `photograph`, if not null, takes the place of the wall (RoomPainter::PaintPhotograph).
  static absl::StatusOr<SceneRenderer> Create(const Intrinsics& intrinsics,
                                              const ImageSize& image_size, const Target& target,
                                              const FrameRenderOptions& options,
                                              const std::vector<float>* photograph = nullptr);

  // width * height * 3: blue, green, red, rows without padding.
  size_t buffer_size() const { return canvas_.size(); }
  const FrameRenderOptions& options() const { return options_; }

  // INVALID_ARGUMENT: `bgr` is not buffer_size() long, the number of spheres is wrong, or their
  // motion is not finite.
  absl::StatusOr<FrameGroundTruth> Render(const SceneFrame& frame, std::span<uint8_t> bgr);

 private:
  SceneRenderer(SphereImager imager, const Target& target, const FrameRenderOptions& options,
                const std::vector<float>* photograph);
  double MiddleRow() const { return 0.5 * (imager_.image_size().height - 1.0); }
  SphereMotion AtItsRow(const SphereMotion& sphere) const;
  void DrawSphere(const SceneFrame& frame, size_t marker, const SphereMotion& sphere,
                  const EdgeProfile& blur, SphereLight its_light);
  void DrawStick(const SceneFrame& frame);
  std::optional<OccludingBar> BarOf(const SceneFrame& frame,
                                    std::span<const MarkerGroundTruth> markers) const;

  SphereImager imager_;
  Target target_;
  FrameRenderOptions options_;
  LightModel light_;
  EdgeProfile profile_, floor_profile_;
  SceneCanvas canvas_;
  SphereImage sphere_image_;
};

}  // namespace rigcal
