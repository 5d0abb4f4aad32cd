// SPDX-License-Identifier: Apache-2.0
#include "tests/accuracy/detection/paper_rig.h"

namespace rigcal::accuracy {

CameraDescription PaperCamera(ImageSize image_size_px, double cy_px) {
  CameraDescription camera;
  camera.camera = "sim";
  camera.image_size_px = image_size_px;
  Intrinsics intrinsics;
  intrinsics.fx_px = 1010;
  intrinsics.fy_px = 1008;
  intrinsics.cx_px = 641;
  intrinsics.cy_px = cy_px;
  intrinsics.distortion = {-0.18, 0.09, 0.0005, -0.0003, -0.01};
  camera.intrinsics = intrinsics;
  return camera;
}

Target PaperWand() {
  Target target;
  target.marker_positions_m = {0, 0.13, 0.39};
  target.diameter_m = 0.04;
  target.blink_hz = {500};
  return target;
}

}  // namespace rigcal::accuracy
