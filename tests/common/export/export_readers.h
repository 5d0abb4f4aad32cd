// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "common/export/archive.h"

// Readers of the exported formats, each written from the documentation of its format and from
// nothing of the writers: the lens models are OpenCV's library or written out here, not
// common/camera.
namespace rigcal::testing {

// A camera as somebody else understands the file.
struct ReadCamera {
  std::string name;
  double width_px = 0, height_px = 0;
  double time_offset_s = 0;  // where the format has one
  // Where a point of the rig frame, metres, is seen; the centre of the first pixel is (0, 0).
  std::function<Eigen::Vector2d(const Eigen::Vector3d&)> project;
};

using ExportedFiles = std::vector<ExportFile>;
using ReadCameras = std::vector<ReadCamera>;

// Each throws std::runtime_error, or an exception of its library, if the files are not of the
// format.
ReadCameras ReadOpenCvYaml(const ExportedFiles& files);
ReadCameras ReadKalibrCamchain(const ExportedFiles& files);
ReadCameras ReadRosFiles(const ExportedFiles& files);
ReadCameras ReadColmapText(const ExportedFiles& files);
ReadCameras ReadColmapBinary(const ExportedFiles& files);
ReadCameras ReadNerfstudioJson(const ExportedFiles& files);
ReadCameras ReadAniposeToml(const ExportedFiles& files);
ReadCameras ReadPose2SimToml(const ExportedFiles& files);
ReadCameras ReadCaliscopeToml(const ExportedFiles& files);
ReadCameras ReadMrcalModels(const ExportedFiles& files);
ReadCameras ReadMcapFile(const ExportedFiles& files);
ReadCameras ReadOpenMvgJson(const ExportedFiles& files);
ReadCameras ReadMatFile(const ExportedFiles& files);
ReadCameras ReadBlenderScript(const ExportedFiles& files);
ReadCameras ReadUsda(const ExportedFiles& files);

// The content of one of the files.
const std::string& ContentOf(const ExportedFiles& files, std::string_view name);

// A camera in OpenCV's terms, projected by OpenCV; pixels as OpenCV counts them.
struct OpenCvCamera {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  std::vector<double> distortion;
  bool fisheye = false;
  Eigen::Matrix4d cam_from_rig = Eigen::Matrix4d::Identity();

  Eigen::Vector2d Project(const Eigen::Vector3d& x_in_rig) const;
};

// Focal lengths and principal point as a matrix.
Eigen::Matrix3d CameraMatrix(double fx, double fy, double cx, double cy);

// Turns a pose of a camera that looks along -z with y up, and a file that has it, into OpenCV's:
// cam_from_rig.
Eigen::Matrix4d FromOpenGlPose(const Eigen::Matrix4d& rig_from_camera);

}  // namespace rigcal::testing
