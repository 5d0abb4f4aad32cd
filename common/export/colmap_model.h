// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/export/rig_model.h"

namespace rigcal {

// A lens in COLMAP's terms (COLMAP's documentation, "Camera models"): fx fy cx cy and the
// coefficients of the smallest model that holds it exactly. The corner of the image is (0, 0)
// there, and the centre of the first pixel (0.5, 0.5).
struct ColmapLens {
  const char* model;  // "OPENCV"
  int32_t model_id;
  std::vector<double> parameters;
};

ColmapLens ColmapLensOf(const ExportedCamera& camera);

// "left.png": COLMAP knows images, not cameras.
std::string ColmapImageOf(const ExportedCamera& camera);

}  // namespace rigcal
