// SPDX-License-Identifier: Apache-2.0
// Cameras of 3-D programs: Blender (manual, "Cameras"; the window that lens, sensor and shifts
// span) and USD (UsdGeomCamera, GfFrustum). Both look along -z with y up and have no distortion.
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "tests/common/export/export_readers.h"

namespace rigcal::testing {
namespace {

// A window at distance 1 before the camera, filled by the image.
struct Window {
  double left = 0, right = 0, bottom = 0, top = 0;
  double width_px = 0, height_px = 0;
  Eigen::Matrix4d rig_from_camera = Eigen::Matrix4d::Identity();

  // From the image's corner, minus half a pixel.
  Eigen::Vector2d Project(const Eigen::Vector3d& x_in_rig) const {
    const Eigen::Vector4d x = rig_from_camera.inverse() * x_in_rig.homogeneous();
    const double across = x.x() / -x.z(), up = x.y() / -x.z();
    return {(across - left) / (right - left) * width_px - 0.5,
            (top - up) / (top - bottom) * height_px - 0.5};
  }
};

ReadCamera Through(const Window& window, const std::string& name) {
  return {.name = name,
          .width_px = window.width_px,
          .height_px = window.height_px,
          .project = [window](const auto& x) { return window.Project(x); }};
}

std::string MatchOf(const std::string& text, const std::string& pattern) {
  std::smatch match;
  if (!std::regex_search(text, match, std::regex(pattern))) {
    throw std::runtime_error("nothing matches " + pattern);
  }
  return match[1];
}

}  // namespace

ReadCameras ReadBlenderScript(const ExportedFiles& files) {
  const std::string& script = ContentOf(files, "rig.py");
  const size_t begin = script.find("CAMERAS = [") + 10, end = script.find("\n]\n", begin);
  std::string list = script.substr(begin, end - begin);
  list.erase(list.rfind(','));  // Python allows it, JSON does not
  ReadCameras cameras;
  for (const auto& entry : nlohmann::json::parse(list + "]")) {
    Window window;
    window.width_px = entry.at("size").at(0);
    window.height_px = entry.at("size").at(1);
    const double pixel_height =
        entry.at("aspect").at(1).get<double>() / entry.at("aspect").at(0).get<double>();
    // The sensor's width is that of the image; shifts are in widths.
    const double half = 36.0 / 2 / entry.at("lens").get<double>();
    const double x = 2 * half * entry.at("shift").at(0).get<double>();
    const double y = 2 * half * entry.at("shift").at(1).get<double>();
    const double half_height = half * window.height_px / window.width_px * pixel_height;
    window.left = x - half, window.right = x + half;
    window.bottom = y - half_height, window.top = y + half_height;
    for (size_t i = 0; i < 16; ++i) {
      window.rig_from_camera(static_cast<int>(i / 4), static_cast<int>(i % 4)) =
          entry.at("matrix").at(i / 4).at(i % 4);
    }
    cameras.push_back(Through(window, entry.at("name")));
  }
  return cameras;
}

ReadCameras ReadUsda(const ExportedFiles& files) {
  const std::string& text = ContentOf(files, "rig.usda");
  if (!text.starts_with("#usda 1.0")) throw std::runtime_error("no USD text");
  ReadCameras cameras;
  const std::regex prims(R"re(def Camera "([A-Za-z_][A-Za-z0-9_]*)"\s*\{([^}]*)\})re");
  for (std::sregex_iterator i(text.begin(), text.end(), prims), end; i != end; ++i) {
    const std::string body = (*i)[2];
    const auto number = [&body](const std::string& name) {
      return static_cast<double>(std::stof(MatchOf(body, "float " + name + " = (\\S+)")));
    };
    Window window;
    const double f = number("focalLength");
    const double half = number("horizontalAperture") / 2, high = number("verticalAperture") / 2;
    const double x = number("horizontalApertureOffset"), y = number("verticalApertureOffset");
    window.left = (x - half) / f, window.right = (x + half) / f;
    window.bottom = (y - high) / f, window.top = (y + high) / f;
    const std::string size = R"(int2 rigcal:imageSize = \((\d+), (\d+)\))";
    window.width_px = std::stod(MatchOf(body, size));
    window.height_px = std::stod(MatchOf(body, R"(int2 rigcal:imageSize = \(\d+, (\d+)\))"));
    std::string matrix = MatchOf(body, R"(matrix4d xformOp:transform = ([^\n]*))");
    for (char& letter : matrix) {
      if (letter == '(' || letter == ')' || letter == ',') letter = ' ';
    }
    std::istringstream numbers(matrix);
    for (int k = 0; k < 16; ++k) numbers >> window.rig_from_camera(k % 4, k / 4);  // row vectors
    if (!numbers) throw std::runtime_error("a matrix has 16 numbers");
    cameras.push_back(Through(window, MatchOf(body, "string rigcal:name = \"([^\"]*)\"")));
  }
  return cameras;
}

}  // namespace rigcal::testing
