// SPDX-License-Identifier: Apache-2.0
#include "common/export/colmap_model.h"

namespace rigcal {

ColmapLens ColmapLensOf(const ExportedCamera& camera) {
  const Intrinsics& intrinsics = camera.intrinsics;
  const std::vector<double> k = camera.Coefficients();
  ColmapLens lens{
      "PINHOLE",
      1,
      {intrinsics.fx_px, intrinsics.fy_px, intrinsics.cx_px + 0.5, intrinsics.cy_px + 0.5}};
  if (!camera.HasDistortion()) return lens;
  lens.parameters.insert(lens.parameters.end(), k.begin(), k.begin() + 4);
  if (intrinsics.model == DistortionModel::kFisheye) {
    lens.model = "OPENCV_FISHEYE";
    lens.model_id = 5;
  } else if (intrinsics.model == DistortionModel::kBrownConrady && k[4] == 0) {
    lens.model = "OPENCV";
    lens.model_id = 4;
  } else {
    lens.model = "FULL_OPENCV";
    lens.model_id = 6;
    lens.parameters.insert(lens.parameters.end(), k.begin() + 4, k.end());
    lens.parameters.resize(12, 0.0);
  }
  return lens;
}

std::string ColmapImageOf(const ExportedCamera& camera) { return camera.name + ".png"; }

}  // namespace rigcal
