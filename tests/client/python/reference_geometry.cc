// SPDX-License-Identifier: Apache-2.0
// Prints what this program's own code makes of points, pixels, times and views, as JSON, for the
// tests of the Python package: rigcal-reference-geometry CALIBRATION.json REQUEST.json
//
// Request: points_rig (N x 3), pixels (M x 2), times_ns, y_px (one for each time), and views: by
// camera K x 2, null where the point is not seen, with the options sigma_px, max_sigmas and
// diameter_m. Answer: by camera pixels, undistorted, rig_times_ns; and points by their number.
// null: there is none.
#include <Eigen/Core>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/results/calibration_file.h"
#include "common/camera/camera_model.h"
#include "common/triangulate/marker_track.h"
#include "common/triangulate/triangulate_rows.h"

namespace rigcal::testing {
namespace {

using nlohmann::json;

// So far apart that no row says anything of another.
constexpr int64_t kBetweenRowsNs = 10'000'000'000;

Eigen::Vector2d PixelOf(const json& pixel) {
  return {pixel[0].get<double>(), pixel[1].get<double>()};
}

json CameraAnswer(const CalibratedCamera& camera, const json& request) {
  json answer = {
      {"pixels", json::array()}, {"undistorted", json::array()}, {"rig_times_ns", json::array()}};
  for (const json& point : request["points_rig"]) {
    Eigen::Vector2d pixel;
    const Eigen::Vector3d in_rig(point[0].get<double>(), point[1].get<double>(),
                                 point[2].get<double>());
    const bool seen = Project(camera.intrinsics, camera.cam_from_rig * in_rig, &pixel);
    answer["pixels"].push_back(seen ? json{pixel.x(), pixel.y()} : json());
  }
  for (const json& pixel : request["pixels"]) {
    const auto straight = Undistort(camera.intrinsics, PixelOf(pixel));
    answer["undistorted"].push_back(straight.ok() ? json{straight->x(), straight->y()} : json());
  }
  for (size_t i = 0; i < request["times_ns"].size(); ++i) {
    answer["rig_times_ns"].push_back(RigTimeNs(camera, request["times_ns"][i].get<int64_t>()) +
                                     LineDelayNs(camera, request["y_px"][i].get<double>()));
  }
  return answer;
}

absl::StatusOr<json> Points(const CalibrationResult& calibration, const json& request) {
  std::vector<CameraRows> rows;
  for (const auto& [camera, views] : request["views"].items()) {
    CameraRows& own = rows.emplace_back();
    own.camera = camera;
    for (size_t i = 0; i < views.size(); ++i) {
      Observation row;
      row.time_ns = kBetweenRowsNs * static_cast<int64_t>(i);
      row.markers.resize(1);
      row.markers[0].visible = !views[i].is_null();
      if (row.markers[0].visible) row.markers[0].centre_px = PixelOf(views[i]);
      own.rows.push_back(row);
    }
  }
  TriangulationOptions options;
  options.sigma_px = request["sigma_px"];
  options.max_sigmas = request["max_sigmas"];
  options.diameter_m = request["diameter_m"];
  const auto triangulation = TriangulateRows(calibration, rows, options);
  if (!triangulation.ok()) return triangulation.status();
  json points = json::object();
  for (const TriangulatedPoint& point : triangulation->points) {
    json cameras = json::array();
    for (const PixelView& view : point.views) {
      cameras.push_back(calibration.cameras[static_cast<size_t>(view.camera)].camera);
    }
    const auto matrix = [](const Eigen::Matrix3d& m) {
      return std::vector<double>(m.data(), m.data() + m.size());
    };
    points[std::to_string(point.rig_time_ns / kBetweenRowsNs)] = {
        {"position_m", {point.position_m.x(), point.position_m.y(), point.position_m.z()}},
        {"noise_m2", matrix(point.noise_m2)},
        {"covariance_m2", matrix(point.covariance_m2)},
        {"error_px", point.error_px},
        {"cameras", cameras}};
  }
  return points;
}

absl::StatusOr<json> Answer(const std::string& calibration_path, const std::string& request_path) {
  const auto file = client::ReadCalibration(calibration_path);
  if (!file.ok()) return file.status();
  const auto calibration = client::ResultOf(*file);
  if (!calibration.ok()) return calibration.status();
  std::ifstream stream(request_path);
  const json request = json::parse(stream);
  json answer = {{"cameras", json::object()}};
  for (const CalibratedCamera& camera : calibration->cameras) {
    answer["cameras"][camera.camera] = CameraAnswer(camera, request);
  }
  if (request["views"].empty()) return answer;
  auto points = Points(*calibration, request);
  if (!points.ok()) return points.status();
  answer["points"] = *points;
  return answer;
}

}  // namespace
}  // namespace rigcal::testing

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: rigcal-reference-geometry CALIBRATION.json REQUEST.json\n";
    return 2;
  }
  const auto answer = rigcal::testing::Answer(argv[1], argv[2]);
  if (!answer.ok()) {
    std::cerr << std::string(answer.status().message()) << "\n";
    return 1;
  }
  std::cout << *answer << "\n";
  return 0;
}
