// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "common/camera/intrinsics.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/target/target.h"

namespace rigcal {

// A sphere's centre around the middle of an exposure, frame `cam`: at dt seconds from it
// centre_m + dt * velocity_m_s + dt^2 / 2 * acceleration_m_s2.
struct SphereMotion {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration_m_s2 = Eigen::Vector3d::Zero();
};

// The wand around the middle of an exposure, frame `cam`.
struct WandMotion {
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  // of marker 0
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();  // of marker 0
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();

  SphereMotion Marker(double position_m) const;
};

// Ground truth of one marker in one frame.
struct MarkerGroundTruth {
  bool projects = false;  // the lens images its centre at all
  bool inside = false;    // the centre lies in the image
  // Projection of the sphere's centre at mid exposure (not the centre of its image); where
  // `projects`.
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double distance_m = 0;
  double radius_px = 0;  // of its image, mean
  // 0 to 1: share of its projection at mid exposure that is within the image and not occluded.
  double visible_share = 0;
};

struct FrameGroundTruth {
  std::vector<MarkerGroundTruth> markers;  // by marker of the target; none without a wand
  double lit_share = 0;                    // of the exposure, of marker 0's LED
  // Every marker's centre in the image and at least `min_share` of each to be seen.
  bool WandVisible(double min_share = 0.98) const;
};

// What changes from frame to frame.
struct SceneFrame {
  std::optional<WandMotion> wand;  // none: the room alone
  uint64_t seed = 0;               // of this frame's noise, occlusion and blink phase
  // Time on the LEDs' oscillator at mid exposure, s; an LED is on during the first `duty` of each
  // period. None: drawn from `seed`.
  std::optional<double> led_time_s;
  // Reflecting floor in frame `cam`: normal . x = offset. None: a glossy surface
  // beside the wand, drawn from `seed`.
  std::optional<Eigen::Vector4d> floor;  // unit normal, offset_m
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
  static absl::StatusOr<SceneRenderer> Create(const Intrinsics& intrinsics,
                                              const ImageSize& image_size, const Target& target,
                                              const FrameRenderOptions& options);
  SceneRenderer(SceneRenderer&&) noexcept;
  SceneRenderer& operator=(SceneRenderer&&) noexcept;
  ~SceneRenderer();

  // width * height * 3: blue, green, red, rows without padding.
  size_t buffer_size() const;
  const ImageSize& image_size() const;
  const FrameRenderOptions& options() const;

  // INVALID_ARGUMENT: `bgr` is not buffer_size() long, or the wand's motion is not finite.
  absl::StatusOr<FrameGroundTruth> Render(const SceneFrame& frame, std::span<uint8_t> bgr);
  // The same with each marker's motion given, none or one per marker.
  absl::StatusOr<FrameGroundTruth> Render(const SceneFrame& frame,
                                          std::span<const SphereMotion> spheres,
                                          std::span<uint8_t> bgr);

 private:
  struct Impl;
  explicit SceneRenderer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal
