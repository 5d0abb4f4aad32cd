// SPDX-License-Identifier: Apache-2.0
// OpenCV's own projection, and its FileStorage files.
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {

const std::string& ContentOf(const ExportedFiles& files, std::string_view name) {
  for (const ExportFile& file : files) {
    if (file.name == name) return file.content;
  }
  throw std::runtime_error("there is no file " + std::string(name));
}

Eigen::Matrix3d CameraMatrix(double fx, double fy, double cx, double cy) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = fx, k(1, 1) = fy, k(0, 2) = cx, k(1, 2) = cy;
  return k;
}

Eigen::Matrix4d FromOpenGlPose(const Eigen::Matrix4d& rig_from_camera) {
  const Eigen::Vector4d flip(1, -1, -1, 1);
  return flip.asDiagonal() * rig_from_camera.inverse();
}

Eigen::Vector2d OpenCvCamera::Project(const Eigen::Vector3d& x_in_rig) const {
  const Eigen::Vector4d x = cam_from_rig * x_in_rig.homogeneous();
  const std::vector<cv::Point3d> points = {{x.x(), x.y(), x.z()}};
  std::vector<cv::Point2d> pixels;
  const cv::Matx33d matrix(k(0, 0), k(0, 1), k(0, 2), k(1, 0), k(1, 1), k(1, 2), k(2, 0), k(2, 1),
                           k(2, 2));
  const cv::Vec3d zero(0, 0, 0);
  if (fisheye) {
    cv::fisheye::projectPoints(points, pixels, zero, zero, matrix, distortion);
  } else {
    cv::projectPoints(points, zero, zero, matrix, distortion, pixels);
  }
  return {pixels[0].x, pixels[0].y};
}

namespace {

Eigen::MatrixXd FileStorageMatrix(const cv::FileStorage& storage, const char* name) {
  cv::Mat matrix;
  storage[name] >> matrix;
  if (matrix.empty()) throw std::runtime_error(std::string("no matrix ") + name);
  Eigen::MatrixXd result(matrix.rows, matrix.cols);
  for (int i = 0; i < matrix.rows; ++i) {
    for (int j = 0; j < matrix.cols; ++j) result(i, j) = matrix.at<double>(i, j);
  }
  return result;
}

}  // namespace

ReadCameras ReadOpenCvYaml(const ExportedFiles& files) {
  ReadCameras cameras;
  for (const ExportFile& file : files) {
    const cv::FileStorage storage(file.content, cv::FileStorage::READ | cv::FileStorage::MEMORY);
    OpenCvCamera camera;
    camera.k = FileStorageMatrix(storage, "camera_matrix");
    const Eigen::MatrixXd distortion = FileStorageMatrix(storage, "distortion_coefficients");
    camera.distortion.assign(distortion.data(), distortion.data() + distortion.size());
    camera.fisheye = storage["distortion_model"].string() == "equidistant";
    camera.cam_from_rig = FileStorageMatrix(storage, "extrinsics");
    cameras.push_back({.name = storage["camera_name"].string(),
                       .width_px = static_cast<double>(storage["image_width"]),
                       .height_px = static_cast<double>(storage["image_height"]),
                       .project = [camera](const auto& x) { return camera.Project(x); }});
  }
  return cameras;
}

}  // namespace rigcal::testing
