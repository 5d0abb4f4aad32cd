// SPDX-License-Identifier: Apache-2.0
// mrcal's .cameramodel, a file per camera: intrinsics are fx fy cx cy and OpenCV's coefficients,
// extrinsics the rotation vector and translation of cam_from_rig, metres. mrcal has no equidistant
// fisheye lens.
#include <Eigen/Geometry>

#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

absl::StatusOr<std::string> CameraModel(const ExportedCamera& camera,
                                        const std::string& calibration_id) {
  const Intrinsics& k = camera.intrinsics;
  if (k.model == DistortionModel::kFisheye) {
    return CannotHold(camera, "mrcal has no fisheye (equidistant) lens model");
  }
  std::vector<double> values = {k.fx_px, k.fy_px, k.cx_px, k.cy_px};
  const std::vector<double> coefficients = camera.Coefficients();
  values.insert(values.end(), coefficients.begin(), coefficients.end());
  const Eigen::AngleAxisd turn(Canonical(camera.cam_from_rig.rotation));
  const Eigen::Vector3d rotation = turn.angle() * turn.axis();
  const Eigen::Vector3d& t = camera.cam_from_rig.translation_m;
  const double pose[] = {rotation.x(), rotation.y(), rotation.z(), t.x(), t.y(), t.z()};
  return absl::StrCat(
      "# ", camera.name, " of the rigcal calibration ", calibration_id,
      "\n{\n    'lensmodel':  'LENSMODEL_OPENCV", coefficients.size(),
      "',\n\n    # fx, fy, cx, cy, distortion\n    'intrinsics': ", DecimalList(values),
      ",\n\n    # rt_fromref: cam_from_rig\n    'extrinsics': ", DecimalList(pose),
      ",\n\n    'imagersize': [ ", camera.image_size_px.width, ", ", camera.image_size_px.height,
      " ]\n}\n");
}

}  // namespace

ExportFiles WriteMrcal(const ExportedRig& rig) {
  std::vector<ExportFile> files;
  for (const ExportedCamera& camera : rig.cameras) {
    RIGCAL_ASSIGN_OR_RETURN(std::string text, CameraModel(camera, rig.calibration_id));
    files.push_back({camera.name + ".cameramodel", std::move(text)});
  }
  return files;
}

}  // namespace rigcal
