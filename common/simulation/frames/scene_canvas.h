// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/light_model.h"
#include "common/simulation/frames/sensor_noise.h"
#include "common/simulation/frames/sphere_image.h"

namespace rigcal {

// The light of one sphere on the pixels it covers, grey levels.
struct SphereLight {
  Bgr led{};             // lit during the whole exposure
  double shell = 0;      // ambient light that it reflects
  double spot = 0;       // directional light that it reflects where it faces it
  double cover = 1;      // how much of what is behind it goes: 0 for a mirror image
  double halo = 0;       // of `led` times `lit_share`, at the rim
  double lit_share = 0;  // of the exposure
};

// Something opaque and straight between camera and wand: a rectangle in the image.
struct OccludingBar {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = Eigen::Vector2d::UnitX();  // across the bar
  double half_width_px = 0;
  double half_length_px = 0;
  double reflectance = 0.1;  // share of the light that it throws back

  // Distance of a pixel from its nearest edge, positive inside.
  double InsidePx(const Eigen::Vector2d& pixel) const;
};

// A stick with round ends as it is at one time of the exposure, in the image.
struct StickImage {
  Eigen::Vector2d begin_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d end_px = Eigen::Vector2d::Zero();
  double begin_half_px = 0, end_half_px = 0;  // half its thickness

  // Distance of a pixel from its edge, positive inside.
  double InsidePx(const Eigen::Vector2d& pixel) const;
};

// The room in linear light, onto which one frame's spheres and bars are put and from which they
// are taken again. One thread at a time.
class SceneCanvas {
 public:
  // `room` as RenderRoom gives it.
  SceneCanvas(const ImageSize& image_size, const FrameRenderOptions& options,
              const LightModel& light, std::vector<int16_t> room);

  size_t size() const { return linear_.size(); }
  // Patches must be within the image.
  void AddSphere(const SphereImage& sphere, const SphereLight& light);
  // A stick in light of its own, averaged over the places it has during the exposure.
  void AddStick(std::span<const StickImage> places, const Bgr& bgr_grey,
                const EdgeProfile& profile);
  void AddBar(const OccludingBar& bar, const EdgeProfile& profile);
  // Grey levels of all pixels with noise that follows from `seed`; `bgr` has size() bytes.
  void Expose(uint64_t seed, std::span<uint8_t> bgr) const;
  // The room alone again.
  void Reset();

 private:
  size_t PixelIndex(int x, int y) const;
  std::span<int16_t> Row(const ImagePatch& patch, int row);
  void Keep(const ImagePatch& patch);
  void UpdateSigma(const ImagePatch& patch);
  double Passed(int x, int y) const;

  ImageSize image_size_;
  double black_grey_;
  double vignetting_;
  double bar_grey_;  // of a bar of reflectance 1
  SensorNoise noise_;
  std::vector<int16_t> linear_;
  std::vector<uint8_t> sigma_;
  // Background of the patches, for Reset.
  std::vector<ImagePatch> kept_patches_;
  std::vector<int16_t> kept_;
};

}  // namespace rigcal
