// SPDX-License-Identifier: Apache-2.0
// kalibr's camchain (kalibr's wiki, "YAML formats") and ROS's camera_info and launch files
// (sensor_msgs/CameraInfo, tf2_ros static_transform_publisher).
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

Eigen::Matrix4d PoseOfRows(const YAML::Node& rows) {
  Eigen::Matrix4d pose;
  if (rows.size() != 4) throw std::runtime_error("a pose has 4 rows");
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) pose(i, j) = rows[i][j].as<double>();
  }
  return pose;
}

std::vector<double> Numbers(const YAML::Node& node) {
  for (const YAML::Node& number : node) {
    // YAML 1.1, which Python reads, takes 1e-5 for a text.
    if (number.as<std::string>().find('.') == std::string::npos) {
      throw std::runtime_error(number.as<std::string>() + " has no decimal point");
    }
  }
  return node.as<std::vector<double>>();
}

// The transforms of a launch file, by child frame: rig_from_child.
std::map<std::string, Eigen::Matrix4d> TransformsOf(const std::string& launch, bool ros2) {
  std::map<std::string, Eigen::Matrix4d> transforms;
  const std::regex arguments(R"(<node pkg="tf2_ros"[^>]* args="([^"]*)\"/>)");
  for (std::sregex_iterator i(launch.begin(), launch.end(), arguments), end; i != end; ++i) {
    std::istringstream words((*i)[1].str());
    std::vector<std::string> all;
    for (std::string word; words >> word;) {
      if (word == "$(arg") continue;
      if (word == "$(var") continue;
      all.push_back(word);
    }
    std::map<std::string, std::string> values;
    const char* const names[] = {
        "--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw", "--frame-id", "--child-frame-id"};
    if (ros2) {
      for (size_t k = 0; k + 1 < all.size(); k += 2) values[all[k]] = all[k + 1];
    } else {
      for (size_t k = 0; k < 9; ++k)
        values[names[k]] = all.at(k);  // x y z qx qy qz qw parent child
    }
    if (values.at("--frame-id") != "rig_frame)") throw std::runtime_error("unknown parent frame");
    const auto number = [&](const char* name) { return std::stod(values.at(name)); };
    const Eigen::Quaterniond q(number("--qw"), number("--qx"), number("--qy"), number("--qz"));
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose.topLeftCorner<3, 3>() = q.toRotationMatrix();
    pose.topRightCorner<3, 1>() << number("--x"), number("--y"), number("--z");
    transforms[values.at("--child-frame-id")] = pose;
  }
  return transforms;
}

}  // namespace

ReadCameras ReadKalibrCamchain(const ExportedFiles& files) {
  const YAML::Node root = YAML::Load(ContentOf(files, "camchain.yaml"));
  ReadCameras cameras;
  Eigen::Matrix4d chained;
  for (size_t i = 0; i < root.size(); ++i) {
    const YAML::Node node = root["cam" + std::to_string(i)];
    OpenCvCamera camera;
    const std::vector<double> k = Numbers(node["intrinsics"]);
    camera.k = CameraMatrix(k.at(0), k.at(1), k.at(2), k.at(3));
    camera.distortion = Numbers(node["distortion_coeffs"]);
    if (camera.distortion.size() != 4) throw std::runtime_error("kalibr has 4 coefficients");
    camera.fisheye = node["distortion_model"].as<std::string>() == "equidistant";
    camera.cam_from_rig = PoseOfRows(node["T_cam_imu"]);
    // Every pose is there twice: from the rig, and from the camera before.
    if (i > 0) {
      chained = PoseOfRows(node["T_cn_cnm1"]) * chained;
      if (!chained.isApprox(camera.cam_from_rig, 1e-9)) throw std::runtime_error("chain is broken");
    } else {
      chained = camera.cam_from_rig;
    }
    const std::string topic = node["rostopic"].as<std::string>();
    const YAML::Node shift = node["timeshift_cam_imu"];
    cameras.push_back({.name = topic.substr(1, topic.find('/', 1) - 1),
                       .width_px = node["resolution"][0].as<double>(),
                       .height_px = node["resolution"][1].as<double>(),
                       .time_offset_s = shift ? shift.as<double>() : 0,
                       .project = [camera](const auto& x) { return camera.Project(x); }});
  }
  return cameras;
}

// mrcal's cameramodel is a dictionary of Python, whose flow style YAML reads, too.
ReadCameras ReadMrcalModels(const ExportedFiles& files) {
  ReadCameras cameras;
  for (const ExportFile& file : files) {
    const YAML::Node node = YAML::Load(file.content);
    OpenCvCamera camera;
    std::vector<double> values = Numbers(node["intrinsics"]);
    const std::string model = node["lensmodel"].as<std::string>();
    if (model != "LENSMODEL_OPENCV" + std::to_string(values.size() - 4)) {
      throw std::runtime_error(model + " does not fit its intrinsics");
    }
    camera.k = CameraMatrix(values.at(0), values.at(1), values.at(2), values.at(3));
    camera.distortion.assign(values.begin() + 4, values.end());
    const std::vector<double> rt = Numbers(node["extrinsics"]);
    const Eigen::Vector3d turn(rt.at(0), rt.at(1), rt.at(2));
    if (turn.norm() > 0) {
      camera.cam_from_rig.topLeftCorner<3, 3>() =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    }
    camera.cam_from_rig.topRightCorner<3, 1>() << rt.at(3), rt.at(4), rt.at(5);
    cameras.push_back({.name = file.name.substr(0, file.name.rfind(".cameramodel")),
                       .width_px = node["imagersize"][0].as<double>(),
                       .height_px = node["imagersize"][1].as<double>(),
                       .time_offset_s = 0,
                       .project = [camera](const auto& x) { return camera.Project(x); }});
  }
  return cameras;
}

ReadCameras ReadRosFiles(const ExportedFiles& files) {
  const auto ros1 = TransformsOf(ContentOf(files, "static_transforms.ros1.launch"), false);
  const auto ros2 = TransformsOf(ContentOf(files, "static_transforms.ros2.launch.xml"), true);
  ReadCameras cameras;
  for (const ExportFile& file : files) {
    if (!file.name.ends_with(".camera_info.yaml")) continue;
    const YAML::Node node = YAML::Load(file.content);
    const std::string name = node["camera_name"].as<std::string>();
    OpenCvCamera camera;
    const std::vector<double> k = Numbers(node["camera_matrix"]["data"]);
    camera.k = CameraMatrix(k.at(0), k.at(4), k.at(2), k.at(5));
    camera.distortion = Numbers(node["distortion_coefficients"]["data"]);
    if (node["distortion_coefficients"]["cols"].as<size_t>() != camera.distortion.size()) {
      throw std::runtime_error("cols of distortion_coefficients are wrong");
    }
    const std::map<std::string, size_t> counts = {
        {"plumb_bob", 5}, {"rational_polynomial", 8}, {"equidistant", 4}};
    const std::string model = node["distortion_model"].as<std::string>();
    if (counts.at(model) != camera.distortion.size()) throw std::runtime_error("wrong count");
    camera.fisheye = model == "equidistant";
    const Eigen::Matrix4d pose = ros1.at(name + "_optical_frame");
    if (!pose.isApprox(ros2.at(name + "_optical_frame"), 1e-12)) {
      throw std::runtime_error("ROS 1 and ROS 2 have different transforms");
    }
    camera.cam_from_rig = pose.inverse();
    cameras.push_back({.name = name,
                       .width_px = node["image_width"].as<double>(),
                       .height_px = node["image_height"].as<double>(),
                       .project = [camera](const auto& x) { return camera.Project(x); }});
  }
  return cameras;
}

}  // namespace rigcal::testing
