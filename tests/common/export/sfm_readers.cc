// SPDX-License-Identifier: Apache-2.0
// COLMAP ("Output format", "Camera models"), nerfstudio ("Data conventions") and OpenMVG
// ("SfM_Data"; the lens models of its cameras module).
#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

struct ColmapModel {
  const char* name;
  size_t parameter_count;
};
const std::map<int, ColmapModel>& ColmapModels() {
  static const auto* const kModels = new std::map<int, ColmapModel>{{1, {"PINHOLE", 4}},
                                                                    {4, {"OPENCV", 8}},
                                                                    {5, {"OPENCV_FISHEYE", 8}},
                                                                    {6, {"FULL_OPENCV", 12}}};
  return *kModels;
}

struct ColmapCamera {
  double width = 0, height = 0;
  std::string model;
  std::vector<double> parameters;
};

ReadCamera FromColmap(const ColmapCamera& read, const Eigen::Quaterniond& q,
                      const Eigen::Vector3d& t, const std::string& image) {
  OpenCvCamera camera;
  const std::vector<double>& p = read.parameters;
  camera.k = CameraMatrix(p.at(0), p.at(1), p.at(2), p.at(3));
  camera.fisheye = read.model == "OPENCV_FISHEYE";
  camera.distortion.assign(p.begin() + 4, p.end());
  camera.cam_from_rig.topLeftCorner<3, 3>() = q.toRotationMatrix();
  camera.cam_from_rig.topRightCorner<3, 1>() = t;
  return {.name = image.substr(0, image.rfind('.')),
          .width_px = read.width,
          .height_px = read.height,
          // The centre of the upper left pixel is (0.5, 0.5) in COLMAP.
          .project = [camera](const auto& x) {
            return Eigen::Vector2d(camera.Project(x) - Eigen::Vector2d(0.5, 0.5));
          }};
}

template <typename Number>
Number Take(const std::string& bytes, size_t* at) {
  Number value;
  if (*at + sizeof value > bytes.size()) throw std::runtime_error("the file is too short");
  std::memcpy(&value, bytes.data() + *at, sizeof value);
  *at += sizeof value;
  return value;
}

double OpenMvgTheta(double theta, const std::vector<double>& k) {
  double result = theta, power = theta;
  for (const double coefficient : k) result += coefficient * (power *= theta * theta);
  return result;
}

Eigen::Vector2d OpenMvgDistorted(const std::string& model, const std::vector<double>& k,
                                 const Eigen::Vector2d& p) {
  const double r2 = p.squaredNorm();
  if (model == "fisheye") {
    const double r = std::sqrt(r2);
    return r > 1e-8 ? Eigen::Vector2d(p * (OpenMvgTheta(std::atan(r), k) / r)) : p;
  }
  if (model == "pinhole") return p;
  if (model != "pinhole_brown_t2") throw std::runtime_error("unknown lens " + model);
  // K1 K2 K3 T1 T2
  const double radial = k.at(0) * r2 + k.at(1) * r2 * r2 + k.at(2) * r2 * r2 * r2;
  const double x = p.x(), y = p.y(), t1 = k.at(3), t2 = k.at(4);
  return {x + x * radial + t2 * (r2 + 2 * x * x) + 2 * t1 * x * y,
          y + y * radial + t1 * (r2 + 2 * y * y) + 2 * t2 * x * y};
}

}  // namespace

ReadCameras ReadColmapText(const ExportedFiles& files) {
  std::map<int, ColmapCamera> cameras;
  std::istringstream camera_lines(ContentOf(files, "cameras.txt"));
  for (std::string line; std::getline(camera_lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    int id = 0;
    ColmapCamera camera;
    words >> id >> camera.model >> camera.width >> camera.height;
    for (double value; words >> value;) camera.parameters.push_back(value);
    size_t expected = 0;
    for (const auto& [number, model] : ColmapModels()) {
      if (camera.model == model.name) expected = model.parameter_count;
    }
    if (camera.parameters.size() != expected) throw std::runtime_error("wrong parameters");
    cameras[id] = camera;
  }
  ReadCameras result;
  std::istringstream image_lines(ContentOf(files, "images.txt"));
  for (std::string line; std::getline(image_lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    int id = 0, camera_id = 0;
    double w, x, y, z, tx, ty, tz;
    std::string name;
    words >> id >> w >> x >> y >> z >> tx >> ty >> tz >> camera_id >> name;
    result.push_back(FromColmap(cameras.at(camera_id), Eigen::Quaterniond(w, x, y, z),
                                Eigen::Vector3d(tx, ty, tz), name));
    if (!std::getline(image_lines, line) || !line.empty()) {
      throw std::runtime_error("the line of an image's points is missing");
    }
  }
  return result;
}

ReadCameras ReadColmapBinary(const ExportedFiles& files) {
  const std::string& camera_bytes = ContentOf(files, "cameras.bin");
  std::map<uint32_t, ColmapCamera> cameras;
  size_t at = 0;
  const auto camera_count = Take<uint64_t>(camera_bytes, &at);
  for (uint64_t i = 0; i < camera_count; ++i) {
    const auto id = Take<uint32_t>(camera_bytes, &at);
    const ColmapModel model = ColmapModels().at(Take<int32_t>(camera_bytes, &at));
    ColmapCamera& camera = cameras[id];
    camera.model = model.name;
    camera.width = static_cast<double>(Take<uint64_t>(camera_bytes, &at));
    camera.height = static_cast<double>(Take<uint64_t>(camera_bytes, &at));
    for (size_t k = 0; k < model.parameter_count; ++k) {
      camera.parameters.push_back(Take<double>(camera_bytes, &at));
    }
  }
  if (at != camera_bytes.size()) throw std::runtime_error("cameras.bin has more");
  const std::string& image_bytes = ContentOf(files, "images.bin");
  ReadCameras result;
  at = 0;
  const auto image_count = Take<uint64_t>(image_bytes, &at);
  for (uint64_t i = 0; i < image_count; ++i) {
    Take<uint32_t>(image_bytes, &at);
    double pose[7];
    for (double& value : pose) value = Take<double>(image_bytes, &at);
    const auto camera_id = Take<uint32_t>(image_bytes, &at);
    const std::string name(image_bytes.c_str() + at);
    at += name.size() + 1;
    if (Take<uint64_t>(image_bytes, &at) != 0) throw std::runtime_error("no points expected");
    result.push_back(FromColmap(cameras.at(camera_id),
                                Eigen::Quaterniond(pose[0], pose[1], pose[2], pose[3]),
                                Eigen::Vector3d(pose[4], pose[5], pose[6]), name));
  }
  if (at != image_bytes.size()) throw std::runtime_error("images.bin has more");
  if (ContentOf(files, "points3D.bin") != std::string(8, '\0')) throw std::runtime_error("points");
  return result;
}

ReadCameras ReadNerfstudioJson(const ExportedFiles& files) {
  const auto root = nlohmann::json::parse(ContentOf(files, "transforms.json"));
  const bool fisheye = root.at("camera_model") == "OPENCV_FISHEYE";
  if (!fisheye && root.at("camera_model") != "OPENCV") throw std::runtime_error("unknown lens");
  ReadCameras result;
  for (const auto& frame : root.at("frames")) {
    const auto number = [&frame](const char* name) { return frame.value(name, 0.0); };
    OpenCvCamera camera;
    camera.k = CameraMatrix(frame.at("fl_x"), frame.at("fl_y"), frame.at("cx"), frame.at("cy"));
    camera.fisheye = fisheye;
    camera.distortion = {number("k1"), number("k2")};
    if (fisheye) {
      camera.distortion.insert(camera.distortion.end(), {number("k3"), number("k4")});
    } else {
      camera.distortion.insert(camera.distortion.end(), {number("p1"), number("p2"), number("k3")});
      if (number("k4") != 0) throw std::runtime_error("OpenCV has no such k4");
    }
    Eigen::Matrix4d pose;
    for (size_t i = 0; i < 4; ++i) {
      for (size_t j = 0; j < 4; ++j) {
        pose(static_cast<int>(i), static_cast<int>(j)) = frame.at("transform_matrix").at(i).at(j);
      }
    }
    camera.cam_from_rig = FromOpenGlPose(pose);
    const std::string path = frame.at("file_path");
    result.push_back({.name = path.substr(7, path.rfind('.') - 7),  // images/NAME.png
                      .width_px = frame.at("w"),
                      .height_px = frame.at("h"),
                      // Rays go through (0.5, 0.5) of each pixel.
                      .project = [camera](const auto& x) {
                        return Eigen::Vector2d(camera.Project(x) - Eigen::Vector2d(0.5, 0.5));
                      }});
  }
  return result;
}

ReadCameras ReadOpenMvgJson(const ExportedFiles& files) {
  const auto root = nlohmann::json::parse(ContentOf(files, "sfm_data.json"));
  std::map<int, nlohmann::json> intrinsics, poses;
  std::map<uint32_t, std::string> models;  // by number, as they come
  for (const auto& entry : root.at("intrinsics")) {
    nlohmann::json value = entry.at("value");
    const uint32_t number = value.at("polymorphic_id");
    if (number >> 31) models[number & 0x7fffffff] = value.at("polymorphic_name");
    value["polymorphic_name"] = models.at(number & 0x7fffffff);
    intrinsics[entry.at("key")] = value;
  }
  for (const auto& entry : root.at("extrinsics")) poses[entry.at("key")] = entry.at("value");
  ReadCameras result;
  std::map<uint32_t, int> objects;
  for (const auto& entry : root.at("views")) {
    const auto& wrapper = entry.at("value").at("ptr_wrapper");
    if (objects[wrapper.at("id")]++ != 0) throw std::runtime_error("two objects of one number");
    const auto& view = wrapper.at("data");
    const auto& intrinsic = intrinsics.at(view.at("id_intrinsic"));
    const auto& data = intrinsic.at("ptr_wrapper").at("data");
    if (objects[intrinsic.at("ptr_wrapper").at("id")]++ != 0) throw std::runtime_error("twice");
    const std::string model = intrinsic.at("polymorphic_name");
    const char* const key = model == "fisheye" ? "fisheye" : "disto_t2";
    const auto k = data.value(key, std::vector<double>());
    const double f = data.at("focal_length");
    const Eigen::Vector2d centre(data.at("principal_point").at(0).get<double>(),
                                 data.at("principal_point").at(1).get<double>());
    const auto& pose = poses.at(view.at("id_pose"));
    Eigen::Matrix3d rotation;
    Eigen::Vector3d position;
    for (int i = 0; i < 3; ++i) {
      position[i] = pose.at("center").at(static_cast<size_t>(i));
      for (int j = 0; j < 3; ++j) {
        rotation(i, j) = pose.at("rotation").at(static_cast<size_t>(i)).at(static_cast<size_t>(j));
      }
    }
    const std::string image = view.at("filename");
    result.push_back({.name = image.substr(0, image.rfind('.')),
                      .width_px = data.at("width"),
                      .height_px = data.at("height"),
                      .project = [=](const Eigen::Vector3d& x) {
                        const Eigen::Vector3d cam = rotation * (x - position);
                        return Eigen::Vector2d(f * OpenMvgDistorted(model, k, cam.hnormalized()) +
                                               centre);
                      }});
  }
  return result;
}

}  // namespace rigcal::testing
