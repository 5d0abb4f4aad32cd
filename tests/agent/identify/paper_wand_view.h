// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "common/camera/camera_description.h"
#include "common/target/target.h"

namespace rigcal::agent {

// A camera without distortion and the paper's wand, of which a sphere at 2 m has a radius of 10 px.
inline constexpr int kViewWidth = 640, kViewHeight = 480;
inline constexpr double kViewFocalPx = 1000;

inline CameraDescription ViewCamera() {
  CameraDescription camera;
  camera.camera = "test";
  camera.image_size_px = {kViewWidth, kViewHeight};
  Intrinsics intrinsics;
  intrinsics.fx_px = intrinsics.fy_px = kViewFocalPx;
  intrinsics.cx_px = 0.5 * kViewWidth;
  intrinsics.cy_px = 0.5 * kViewHeight;
  camera.intrinsics = intrinsics;
  return camera;
}

inline Target PaperWand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  target.diameter_m = 0.04;
  return target;
}

}  // namespace rigcal::agent
