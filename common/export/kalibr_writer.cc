// SPDX-License-Identifier: Apache-2.0
// kalibr's camchain ("YAML formats" in kalibr's wiki), as kalibr writes it after a calibration with
// an IMU: the rig frame stands where the IMU's is, so that T_cam_imu is cam_from_rig and
// timeshift_cam_imu the clock offset (t_imu = t_cam + shift). Radtan has k1 k2 p1 p2 alone.
#include "absl/strings/str_cat.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

struct KalibrLens {
  const char* model;
  std::vector<double> coefficients;
};

absl::StatusOr<KalibrLens> KalibrLensOf(const ExportedCamera& camera) {
  std::vector<double> k = camera.Coefficients();
  switch (camera.intrinsics.model) {
    case DistortionModel::kFisheye:
      return KalibrLens{"equidistant", std::move(k)};
    case DistortionModel::kRational:
      return CannotHold(camera, "kalibr has no lens model with 8 coefficients (rational)");
    case DistortionModel::kBrownConrady:
      break;
  }
  if (k[4] != 0) {
    return CannotHold(camera, absl::StrCat("its lens has a third radial coefficient (k3 = ", k[4],
                                           "), kalibr's radtan has two"));
  }
  k.resize(4);
  return KalibrLens{"radtan", std::move(k)};
}

std::string PoseLines(const char* key, const RigidTransform& pose) {
  std::string lines = absl::StrCat("  ", key, ":\n");
  for (const std::string& row : DecimalRows<4, 4>(pose.Matrix())) {
    absl::StrAppend(&lines, "  - ", row, "\n");
  }
  return lines;
}

absl::StatusOr<std::string> CameraLines(const ExportedRig& rig, size_t index) {
  const ExportedCamera& camera = rig.cameras[index];
  RIGCAL_ASSIGN_OR_RETURN(const KalibrLens lens, KalibrLensOf(camera));
  const Intrinsics& k = camera.intrinsics;
  std::string lines = absl::StrCat("cam", index, ":  # ", camera.name, "\n");
  lines += PoseLines("T_cam_imu", camera.cam_from_rig);
  if (index > 0) {
    lines +=
        PoseLines("T_cn_cnm1", camera.cam_from_rig * rig.cameras[index - 1].cam_from_rig.Inverse());
  }
  const double intrinsics[] = {k.fx_px, k.fy_px, k.cx_px, k.cy_px};
  if (camera.refit_error_px > 0) {
    absl::StrAppend(&lines, "  # the lens is refitted: up to ", DecimalText(camera.refit_error_px),
                    " px off in the image\n");
  }
  absl::StrAppend(&lines, "  camera_model: pinhole\n",
                  "  distortion_coeffs: ", DecimalList(lens.coefficients),
                  "\n  distortion_model: ", lens.model, "\n  intrinsics: ", DecimalList(intrinsics),
                  "\n  resolution: [", camera.image_size_px.width, ", ",
                  camera.image_size_px.height, "]\n  rostopic: \"/", camera.name, "/image_raw\"\n");
  if (!camera.clock_course.empty()) {
    absl::StrAppend(&lines,
                    "  # no timeshift_cam_imu, which is constant: this clock jumped or "
                    "drifted while it was recorded\n");
  } else if (camera.time_rate_ppm == 0) {
    absl::StrAppend(&lines, "  timeshift_cam_imu: ", DecimalText(camera.time_offset_s), "\n");
  } else {
    absl::StrAppend(&lines, "  # no timeshift_cam_imu, which is constant: this clock is off by ",
                    DecimalText(camera.time_rate_ppm), " ppm, and by ",
                    DecimalText(camera.time_offset_s), " s at camera time ",
                    DecimalText(camera.time_epoch_s), " s\n");
  }
  return lines;
}

}  // namespace

ExportFiles WriteKalibr(const ExportedRig& rig) {
  std::string text = absl::StrCat("# rigcal calibration ", rig.calibration_id,
                                  ". T_cam_imu is cam_from_rig, metres; the rig frame stands in "
                                  "for the IMU's.\n");
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string lines, CameraLines(rig, i));
    text += lines;
  }
  return std::vector<ExportFile>{{"camchain.yaml", std::move(text)}};
}

}  // namespace rigcal
