// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "common/camera/intrinsics.h"
#include "common/simulation/frames/edge_profile.h"
#include "common/simulation/frames/frame_render_options.h"
#include "common/simulation/frames/light_model.h"

namespace rigcal {

// Share of the light that the lens passes at a pixel: 1 in the middle, 1 - vignetting in the
// corners.
double VignettingAt(const ImageSize& image_size, double vignetting, double x_px, double y_px);

// Something before the wall: a rotated rectangle or ellipse. `bgr_grey` is its light without
// vignetting, grey levels above black.
struct RoomShape {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d axis = Eigen::Vector2d::UnitX();    // unit
  Eigen::Vector2d half_px = Eigen::Vector2d::Ones();  // along the axis, and across
  Bgr bgr_grey{};
  bool round = false;
  bool glows = false;   // has a halo, by the lens' bloom
  double grain_px = 0;  // width of the rings of wood; 0: none
  double grain_bend = 0;
  double cloth = 0;  // folds of cloth: relative change of brightness
  // Relative change of brightness from the middle to the edge, along the axis and across.
  Eigen::Vector2d shade = Eigen::Vector2d::Zero();
};

// Paints a room in grey levels above black, without vignetting. One thread at a time.
class RoomPainter {
 public:
  RoomPainter(const ImageSize& image_size, const FrameRenderOptions& options,
              const LightModel& light, const EdgeProfile& profile);

  const ImageSize& image_size() const { return size_; }
  // Grey of a surface of reflectance 1 in the room's mean light, and of a light of 1 cd/m^2.
  double surface_grey() const { return light_.grey_per_cd_m2 * light_.room_cd_m2; }
  double grey_per_cd_m2() const { return light_.grey_per_cd_m2; }

  // A wall of slowly varying reflectance.
  void PaintWall();
  // A photograph behind everything: three values from 0 to 1 for each pixel of the image, blue,
  // green, red, in linear light; 1 is a white surface in the room's mean light.
  void PaintPhotograph(const std::vector<float>& bgr);
  void Paint(const RoomShape& shape);

  // With vignetting and black level, as sensor_noise.h says.
  std::vector<int16_t> Linear() const;

 private:
  const ImageSize size_;
  const FrameRenderOptions& options_;
  const LightModel& light_;
  const EdgeProfile& profile_;
  std::vector<float> grey_;
};

}  // namespace rigcal
