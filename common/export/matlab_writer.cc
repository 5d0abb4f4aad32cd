// SPDX-License-Identifier: Apache-2.0
// A MATLAB file of level 5 with a struct array `cameras`. Pixels are MATLAB's: the centre of the
// first one is (1, 1). The order is MATLAB's, too: ImageSize is [rows columns], and a point is
// projected as K * (R * x + t). Where the lens is one that cameraIntrinsics has, its coefficients
// are there under cameraIntrinsics' names as well.
#include "absl/strings/str_cat.h"
#include "common/export/format_writers.h"
#include "common/export/mat_file.h"

namespace rigcal {
namespace {

std::string MatNumber(double value) { return MatRow("", std::span<const double>(&value, 1)); }

MatFields LensFields(const ExportedCamera& camera) {
  const Intrinsics& intrinsics = camera.intrinsics;
  const std::vector<double> k = camera.Coefficients();
  Eigen::Matrix3d matrix;
  matrix << intrinsics.fx_px, 0, intrinsics.cx_px + 1, 0, intrinsics.fy_px, intrinsics.cy_px + 1, 0,
      0, 1;
  const double size[] = {static_cast<double>(camera.image_size_px.height),
                         static_cast<double>(camera.image_size_px.width)};
  std::vector<double> radial, tangential;
  if (intrinsics.model == DistortionModel::kBrownConrady) {
    radial = {k[0], k[1], k[4]};
    tangential = {k[2], k[3]};
  }
  return {{"ImageSize", MatRow("", size)},
          {"K", MatMatrix("", matrix)},
          {"DistortionModel", MatText("", DistortionModelName(intrinsics.model))},
          {"DistortionCoefficients", MatRow("", k)},
          {"RadialDistortion", MatRow("", radial)},
          {"TangentialDistortion", MatRow("", tangential)}};
}

MatFields SigmaFields(const ExportedCamera& camera) {
  const auto row_of = [](const Eigen::Vector3d& v) {
    return MatRow("", std::span<const double>(v.data(), 3));
  };
  if (!camera.sigma) {
    return {{"RotationSigma", MatRow("", {})},
            {"PositionSigma", MatRow("", {})},
            {"IntrinsicsSigma", MatRow("", {})}};
  }
  return {{"RotationSigma", row_of(camera.sigma->rotation_rad)},
          {"PositionSigma", row_of(camera.sigma->position_m)},
          {"IntrinsicsSigma", MatRow("", camera.sigma->intrinsics)}};
}

// A corner in each row: camera time and what is to be added to rig time, seconds.
Eigen::MatrixXd CourseMatrix(const ClockCourseLine& course) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(course.size()), course.empty() ? 0 : 2);
  for (size_t i = 0; i < course.size(); ++i) {
    matrix.row(static_cast<Eigen::Index>(i))
        << 1e-9 * static_cast<double>(course[i].camera_time_ns),
        course[i].offset_s;
  }
  return matrix;
}

MatFields FieldsOf(const ExportedCamera& camera) {
  MatFields fields = {{"name", MatText("", camera.name)}};
  const MatFields lens = LensFields(camera);
  fields.insert(fields.end(), lens.begin(), lens.end());
  fields.emplace_back("R", MatMatrix("", camera.cam_from_rig.rotation.toRotationMatrix()));
  fields.emplace_back("t", MatMatrix("", camera.cam_from_rig.translation_m));
  fields.emplace_back("TimeOffset", MatNumber(camera.time_offset_s));
  fields.emplace_back("TimeRatePpm", MatNumber(camera.time_rate_ppm));
  fields.emplace_back("TimeEpoch", MatNumber(camera.time_epoch_s));
  fields.emplace_back("ClockCourse", MatMatrix("", CourseMatrix(camera.clock_course)));
  fields.emplace_back("LineDelay", MatNumber(camera.line_delay_s));
  fields.emplace_back("MeanReprojectionError", MatNumber(camera.mean_error_px));
  const MatFields sigma = SigmaFields(camera);
  fields.insert(fields.end(), sigma.begin(), sigma.end());
  return fields;
}

}  // namespace

ExportFiles WriteMatlab(const ExportedRig& rig) {
  std::vector<MatFields> cameras;
  for (const ExportedCamera& camera : rig.cameras) cameras.push_back(FieldsOf(camera));
  const MatFields calibration = {
      {"id", MatText("", rig.calibration_id)},
      {"units", MatText("", "metres, seconds, radians, pixels; first pixel (1, 1)")},
      {"ScaleSigmaRelative", MatNumber(rig.scale_sigma_rel)}};
  const std::string variables[] = {MatStructs("cameras", cameras),
                                   MatStructs("calibration", std::span(&calibration, 1))};
  return std::vector<ExportFile>{
      {"rig.mat",
       MatFile(absl::StrCat("MATLAB 5.0 MAT-file, rigcal calibration ", rig.calibration_id),
               variables)}};
}

}  // namespace rigcal
