// SPDX-License-Identifier: Apache-2.0
// ROS: a camera_info YAML per camera, as camera_calibration_parsers and camera_info_manager of ROS
// 1 and 2 read it (sensor_msgs/CameraInfo), and static transforms of all cameras as a launch file
// for each. A camera's frame is the optical one of REP 103 (x right, y down, z forward); pixels are
// OpenCV's.
#include "absl/strings/str_cat.h"
#include "common/export/camera_file_names.h"
#include "common/export/decimal_text.h"
#include "common/export/format_writers.h"

namespace rigcal {
namespace {

std::string MatrixLines(const char* key, int rows, const std::vector<double>& values) {
  return absl::StrCat(key, ":\n  rows: ", rows,
                      "\n  cols: ", values.size() / static_cast<size_t>(rows),
                      "\n  data: ", DecimalList(values), "\n");
}

std::string CameraInfoText(const ExportedCamera& camera) {
  const Intrinsics& k = camera.intrinsics;
  std::string text = absl::StrCat("image_width: ", camera.image_size_px.width,
                                  "\nimage_height: ", camera.image_size_px.height,
                                  "\ncamera_name: \"", camera.name, "\"\n");
  text += MatrixLines("camera_matrix", 3, {k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1});
  absl::StrAppend(&text, "distortion_model: ", std::string(DistortionModelName(k.model)), "\n");
  text += MatrixLines("distortion_coefficients", 1, camera.Coefficients());
  text += MatrixLines("rectification_matrix", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  text += MatrixLines("projection_matrix", 3,
                      {k.fx_px, 0, k.cx_px, 0, 0, k.fy_px, k.cy_px, 0, 0, 0, 1, 0});
  return text;
}

std::string RosFrame(const ExportedCamera& camera) { return camera.name + "_optical_frame"; }

// Both programs name the transform by the pose of the child's frame in the parent's.
std::string Ros1Node(const ExportedCamera& camera, size_t index) {
  const RigidTransform pose = camera.cam_from_rig.Inverse();
  const Eigen::Vector3d& t = pose.translation_m;
  const Eigen::Quaterniond q = Canonical(pose.rotation);
  std::string numbers;
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
    absl::StrAppend(&numbers, DecimalText(value), " ");
  }
  return absl::StrCat(
      "  <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" name=\"rig_camera_", index,
      "\" args=\"", numbers, "$(arg rig_frame) ", RosFrame(camera), "\"/>\n");
}

std::string Ros2Node(const ExportedCamera& camera, size_t index) {
  const RigidTransform pose = camera.cam_from_rig.Inverse();
  const Eigen::Vector3d& t = pose.translation_m;
  const Eigen::Quaterniond q = Canonical(pose.rotation);
  return absl::StrCat(
      "  <node pkg=\"tf2_ros\" exec=\"static_transform_publisher\" name=\"rig_camera_", index,
      "\" args=\"--x ", DecimalText(t.x()), " --y ", DecimalText(t.y()), " --z ",
      DecimalText(t.z()), " --qx ", DecimalText(q.x()), " --qy ", DecimalText(q.y()), " --qz ",
      DecimalText(q.z()), " --qw ", DecimalText(q.w()),
      " --frame-id $(var rig_frame) --child-frame-id ", RosFrame(camera), "\"/>\n");
}

std::string LaunchText(const ExportedRig& rig, std::string (*node)(const ExportedCamera&, size_t)) {
  std::string text = absl::StrCat("<!-- rigcal calibration ", rig.calibration_id,
                                  ": the pose of each camera in the rig frame, metres -->\n"
                                  "<launch>\n  <arg name=\"rig_frame\" default=\"rig\"/>\n");
  for (size_t i = 0; i < rig.cameras.size(); ++i) text += node(rig.cameras[i], i);
  return text + "</launch>\n";
}

}  // namespace

ExportFiles WriteRos(const ExportedRig& rig) {
  std::vector<ExportFile> files;
  const std::vector<std::string> names = CameraFileNames(rig);
  for (const ExportedCamera& camera : rig.cameras) {
    files.push_back({names[files.size()] + ".camera_info.yaml", CameraInfoText(camera)});
  }
  if (!rig.has_poses) return files;
  files.push_back({"static_transforms.ros1.launch", LaunchText(rig, &Ros1Node)});
  files.push_back({"static_transforms.ros2.launch.xml", LaunchText(rig, &Ros2Node)});
  return files;
}

}  // namespace rigcal
