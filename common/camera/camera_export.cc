// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_export.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

std::string YamlOf(const CameraExport& camera) {
  const Intrinsics& intrinsics = camera.intrinsics;
  const cv::Mat1d matrix = (cv::Mat1d(3, 3) << intrinsics.fx_px, 0, intrinsics.cx_px, 0,
                            intrinsics.fy_px, intrinsics.cy_px, 0, 0, 1);
  cv::Mat distortion = cv::Mat::zeros(1, CoefficientCount(intrinsics.model), CV_64F);
  std::copy(intrinsics.distortion.begin(), intrinsics.distortion.end(), distortion.begin<double>());
  cv::FileStorage storage(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "camera_name" << camera.camera;
  storage << "image_width" << static_cast<int>(camera.image_size_px.width);
  storage << "image_height" << static_cast<int>(camera.image_size_px.height);
  storage << "camera_matrix" << matrix;
  storage << "distortion_model" << std::string(DistortionModelName(intrinsics.model));
  storage << "distortion_coefficients" << distortion;
  if (camera.cam_from_rig) {
    cv::Mat extrinsics(4, 4, CV_64F);
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(extrinsics.ptr<double>()) =
        camera.cam_from_rig->Matrix();
    storage << "extrinsics" << extrinsics;
    storage << "reprojection_error" << camera.reprojection_error_px;
  }
  if (camera.line_delay_s != 0) storage << "line_delay" << camera.line_delay_s;
  return storage.releaseAndGetString();
}

}  // namespace

absl::StatusOr<std::string> CameraExportText(const CameraExport& camera) {
  FaultList faults;
  faults.Add(camera.image_size_px.Validate());
  faults.Add(camera.intrinsics.Validate(camera.image_size_px));
  if ((camera.cam_from_rig && !camera.cam_from_rig->Matrix().allFinite()) ||
      !std::isfinite(camera.reprojection_error_px + camera.line_delay_s)) {
    faults.Add("pose, error or line delay is not finite");
  }
  RIGCAL_RETURN_IF_ERROR(
      faults.Result(absl::StrCat("not written, camera \"", camera.camera, "\": ")));
  try {
    return YamlOf(camera);
  } catch (const std::exception& exception) {
    return absl::InternalError(absl::StrCat("OpenCV cannot write the YAML: ", exception.what()));
  }
}

absl::Status WriteCameraExport(const std::string& path, const CameraExport& camera) {
  const absl::StatusOr<std::string> text = CameraExportText(camera);
  if (text.ok()) return WriteOutputFile(path, *text);
  return absl::Status(text.status().code(),
                      absl::StrCat(path, ": ", std::string(text.status().message())));
}

}  // namespace rigcal
