// SPDX-License-Identifier: Apache-2.0
#include "common/camera/camera_export.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  int Release() { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

absl::Status ErrnoStatus(const std::string& path, const char* what, int error) {
  return absl::ErrnoToStatus(error, absl::StrCat(path, ": cannot ", what));
}

std::string CameraExportText(const CameraExport& camera) {
  const Intrinsics& intrinsics = camera.intrinsics;
  cv::Mat matrix = cv::Mat::eye(3, 3, CV_64F);
  matrix.at<double>(0, 0) = intrinsics.fx_px;
  matrix.at<double>(0, 2) = intrinsics.cx_px;
  matrix.at<double>(1, 1) = intrinsics.fy_px;
  matrix.at<double>(1, 2) = intrinsics.cy_px;
  cv::Mat distortion = cv::Mat::zeros(1, CoefficientCount(intrinsics.model), CV_64F);
  std::copy(intrinsics.distortion.begin(), intrinsics.distortion.end(), distortion.begin<double>());
  cv::Mat extrinsics(4, 4, CV_64F);
  const Eigen::Matrix4d cam_from_rig = camera.cam_from_rig.Matrix();
  for (int row = 0; row < 4; ++row) {
    for (int col = 0; col < 4; ++col) extrinsics.at<double>(row, col) = cam_from_rig(row, col);
  }
  cv::FileStorage storage(".yaml", cv::FileStorage::WRITE | cv::FileStorage::MEMORY);
  storage << "camera_name" << camera.camera;
  storage << "image_width" << static_cast<int>(camera.image_size_px.width);
  storage << "image_height" << static_cast<int>(camera.image_size_px.height);
  storage << "camera_matrix" << matrix;
  storage << "distortion_model" << std::string(DistortionModelName(intrinsics.model));
  storage << "distortion_coefficients" << distortion;
  storage << "extrinsics" << extrinsics;
  storage << "reprojection_error" << camera.reprojection_error_px;
  return storage.releaseAndGetString();
}

absl::Status WriteDurably(const std::string& path, const std::string& text) {
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (file.get() < 0) return ErrnoStatus(path, "create", errno);
  size_t written = 0;
  while (written < text.size()) {
    const ssize_t count = ::write(file.get(), text.data() + written, text.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return ErrnoStatus(path, "write", errno);
    written += static_cast<size_t>(count);
  }
  if (::fsync(file.get()) != 0) return ErrnoStatus(path, "sync", errno);
  if (::close(file.Release()) != 0) return ErrnoStatus(path, "close", errno);
  return absl::OkStatus();
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
  const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  // Without this the new name may be lost with the power; some file systems cannot and say EINVAL.
  if (directory.get() < 0 || (::fsync(directory.get()) != 0 && errno != EINVAL)) {
    return ErrnoStatus(folder, "sync the folder", errno);
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteCameraExport(const std::string& path, const CameraExport& camera) {
  absl::Status valid = camera.image_size_px.Validate();
  if (valid.ok()) valid = camera.intrinsics.Validate(camera.image_size_px);
  if (!valid.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not written, camera \"", camera.camera,
                                                   "\": ", std::string(valid.message())));
  }
  if (!camera.cam_from_rig.Matrix().allFinite() || !std::isfinite(camera.reprojection_error_px)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not written, camera \"", camera.camera,
                                                   "\": pose or error is not finite"));
  }
  try {
    return ReplaceFile(path, CameraExportText(camera));
  } catch (const std::exception& exception) {
    return absl::InternalError(
        absl::StrCat(path, ": OpenCV cannot write the YAML: ", exception.what()));
  }
}

}  // namespace rigcal
