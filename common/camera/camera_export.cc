// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_export.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>

#include "absl/strings/str_cat.h"
#include "common/status/fault_list.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

absl::Status ErrnoStatus(const std::string& path, const char* what, int error) {
  return absl::ErrnoToStatus(error, absl::StrCat(path, ": cannot ", what));
}

std::string YamlOf(const CameraExport& camera) {
  const Intrinsics& intrinsics = camera.intrinsics;
  const cv::Mat1d matrix = (cv::Mat1d(3, 3) << intrinsics.fx_px, 0, intrinsics.cx_px, 0,
                            intrinsics.fy_px, intrinsics.cy_px, 0, 0, 1);
  cv::Mat distortion = cv::Mat::zeros(1, CoefficientCount(intrinsics.model), CV_64F);
  std::copy(intrinsics.distortion.begin(), intrinsics.distortion.end(), distortion.begin<double>());
  cv::Mat extrinsics(4, 4, CV_64F);
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(extrinsics.ptr<double>()) =
      camera.cam_from_rig.Matrix();
  cv::FileStorage storage(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "camera_name" << camera.camera;
  storage << "image_width" << static_cast<int>(camera.image_size_px.width);
  storage << "image_height" << static_cast<int>(camera.image_size_px.height);
  storage << "camera_matrix" << matrix;
  storage << "distortion_model" << std::string(DistortionModelName(intrinsics.model));
  storage << "distortion_coefficients" << distortion;
  storage << "extrinsics" << extrinsics;
  storage << "reprojection_error" << camera.reprojection_error_px;
  if (camera.line_delay_s != 0) storage << "line_delay" << camera.line_delay_s;
  return storage.releaseAndGetString();
}

absl::Status WriteDurably(const std::string& path, const std::string& text) {
  std::FILE* const file = std::fopen(path.c_str(), "we");
  if (file == nullptr) return ErrnoStatus(path, "create", errno);
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size() &&
                       std::fflush(file) == 0 && ::fsync(::fileno(file)) == 0;
  const int error = errno;
  const bool closed = std::fclose(file) == 0;
  if (!written) return ErrnoStatus(path, "write", error);
  return closed ? absl::OkStatus() : ErrnoStatus(path, "close", errno);
}

absl::Status ReplaceFile(const std::string& path, const std::string& text) {
  const std::string temporary = absl::StrCat(path, ".", ::getpid(), ".tmp");
  absl::Status status = WriteDurably(temporary, text);
  if (status.ok() && ::rename(temporary.c_str(), path.c_str()) != 0) {
    status = ErrnoStatus(path, "replace", errno);
  }
  if (!status.ok()) {
    ::unlink(temporary.c_str());
    return status;
  }
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  // Without this the new name may be lost with the power; some file systems cannot and say EINVAL.
  if (directory < 0 || (::fsync(directory) != 0 && errno != EINVAL)) {
    status = ErrnoStatus(folder, "sync the folder", errno);
  }
  if (directory >= 0) ::close(directory);
  return status;
}

}  // namespace

absl::StatusOr<std::string> CameraExportText(const CameraExport& camera) {
  FaultList faults;
  faults.Add(camera.image_size_px.Validate());
  faults.Add(camera.intrinsics.Validate(camera.image_size_px));
  if (!camera.cam_from_rig.Matrix().allFinite() ||
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
  if (text.ok()) return ReplaceFile(path, *text);
  return absl::Status(text.status().code(),
                      absl::StrCat(path, ": ", std::string(text.status().message())));
}

}  // namespace rigcal
