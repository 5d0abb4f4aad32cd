// SPDX-License-Identifier: Apache-2.0
// anipose (aniposelib's Camera and FisheyeCamera, which call OpenCV), Pose2Sim and caliscope.
#include <toml++/toml.h>

#include <Eigen/Geometry>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

// Readers of older TOML refuse a list of whole and other numbers.
std::vector<double> Floats(const toml::node_view<const toml::node>& node) {
  std::vector<double> values;
  for (const toml::node& element : *node.as_array()) {
    if (!element.is_floating_point()) throw std::runtime_error("a number without decimal point");
    values.push_back(element.as_floating_point()->get());
  }
  return values;
}

ReadCamera FromToml(const toml::table& table, const std::string& name) {
  OpenCvCamera camera;
  for (size_t i = 0; i < 3; ++i) {
    const std::vector<double> row = Floats(table["matrix"][i]);
    for (size_t j = 0; j < 3; ++j) camera.k(static_cast<int>(i), static_cast<int>(j)) = row.at(j);
  }
  camera.distortion = Floats(table["distortions"]);
  camera.fisheye = table["fisheye"].value_or(false);
  const std::vector<double> r = Floats(table["rotation"]), t = Floats(table["translation"]);
  const Eigen::Vector3d vector(r.at(0), r.at(1), r.at(2));
  if (vector.norm() > 0) {
    camera.cam_from_rig.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(vector.norm(), vector.normalized()).toRotationMatrix();
  }
  camera.cam_from_rig.topRightCorner<3, 1>() << t.at(0), t.at(1), t.at(2);
  return {.name = name,
          .width_px = table["size"][0].value<double>().value(),
          .height_px = table["size"][1].value<double>().value(),
          .project = [camera](const auto& x) { return camera.Project(x); }};
}

ReadCameras Sections(const std::string& text) {
  const toml::table root = toml::parse(text);
  ReadCameras cameras;
  for (const auto& [key, value] : root) {  // by name, as aniposelib sorts them
    if (key == "metadata") continue;
    cameras.push_back(FromToml(*value.as_table(), (*value.as_table())["name"].value_or("")));
  }
  return cameras;
}

}  // namespace

ReadCameras ReadAniposeToml(const ExportedFiles& files) {
  return Sections(ContentOf(files, "calibration.toml"));
}

ReadCameras ReadPose2SimToml(const ExportedFiles& files) {
  return Sections(ContentOf(files, "Calib_rigcal.toml"));
}

ReadCameras ReadCaliscopeToml(const ExportedFiles& files) {
  const toml::table root = toml::parse(ContentOf(files, "camera_array.toml"));
  ReadCameras cameras;
  const toml::table& all = *root["cameras"].as_table();
  for (size_t i = 0; i < all.size(); ++i) {
    const toml::table& camera = *all[std::to_string(i)].as_table();
    if (camera["cam_id"].value_or<int64_t>(-1) != static_cast<int64_t>(i)) {
      throw std::runtime_error("cam_id is not the key");
    }
    cameras.push_back(FromToml(camera, camera["name"].value_or("")));
  }
  return cameras;
}

}  // namespace rigcal::testing
