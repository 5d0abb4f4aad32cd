// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace rigcal::agent {

// A calibration as a recorded camera has it beside its CSV file.
inline constexpr char kCameraYaml[] = R"(%YAML:1.0
camera_name: whatever
image_width: 1280
image_height: 1024
camera_matrix: !!opencv-matrix
  rows: 3
  cols: 3
  dt: d
  data: [1255.4, 0, 652.7, 0, 1253.6, 506.8, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients: !!opencv-matrix
  rows: 1
  cols: 5
  dt: d
  data: [-0.22, 0.24, -0.00025, 0.0012, -0.2]
)";

}  // namespace rigcal::agent
