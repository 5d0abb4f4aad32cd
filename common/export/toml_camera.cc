// SPDX-License-Identifier: Apache-2.0
#include "common/export/toml_camera.h"

#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"

namespace rigcal {

std::string TomlCameraFields(const ExportedCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  Eigen::Matrix3d matrix;
  matrix << k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1;
  const Eigen::AngleAxisd turn(Canonical(camera.cam_from_rig.rotation));
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  return absl::StrCat("size = [", camera.image_size_px.width, ", ", camera.image_size_px.height,
                      "]\nmatrix = ", DecimalMatrix<3, 3>(matrix),
                      "\ndistortions = ", DecimalList(camera.Coefficients()),
                      "\nrotation = ", DecimalList(rotation),
                      "\ntranslation = ", DecimalList(camera.cam_from_rig.translation_m),
                      "\nfisheye = ", k.model == DistortionModel::kFisheye ? "true" : "false",
                      "\n");
}

}  // namespace rigcal
