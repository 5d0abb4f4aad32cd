// SPDX-License-Identifier: Apache-2.0
// nerfstudio's transforms.json ("Data conventions" in its documentation): cameras look along -z
// with y up, transform_matrix is rig_from_cam, and the centre of the first pixel is (0.5, 0.5).
// One camera_model holds for the whole file; OPENCV has radial terms up to the eighth power and no
// denominator.
#include <nlohmann/json.hpp>

#include "common/export/format_writers.h"
#include "common/export/opengl_pose.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

absl::StatusOr<nlohmann::ordered_json> FrameOf(const ExportedCamera& camera) {
  if (camera.intrinsics.model == DistortionModel::kRational) {
    return CannotHold(camera, "nerfstudio has no lens model with 8 coefficients (rational)");
  }
  const Intrinsics& intrinsics = camera.intrinsics;
  const std::vector<double> k = camera.Coefficients();
  nlohmann::ordered_json frame = {{"file_path", "images/" + camera.name + ".png"},
                                  {"fl_x", intrinsics.fx_px},
                                  {"fl_y", intrinsics.fy_px},
                                  {"cx", intrinsics.cx_px + 0.5},
                                  {"cy", intrinsics.cy_px + 0.5},
                                  {"w", camera.image_size_px.width},
                                  {"h", camera.image_size_px.height}};
  if (intrinsics.model == DistortionModel::kFisheye) {
    frame.update({{"k1", k[0]}, {"k2", k[1]}, {"k3", k[2]}, {"k4", k[3]}});
  } else {
    frame.update({{"k1", k[0]}, {"k2", k[1]}, {"k3", k[4]}, {"p1", k[2]}, {"p2", k[3]}});
  }
  // A field of ours, which nerfstudio ignores.
  if (camera.refit_error_px > 0) frame["rigcal_lens_error_px"] = camera.refit_error_px;
  const Eigen::Matrix4d pose = RigFromOpenGlCamera(camera);
  auto matrix = nlohmann::ordered_json::array();
  for (int i = 0; i < 4; ++i) {
    matrix.push_back({pose(i, 0), pose(i, 1), pose(i, 2), pose(i, 3)});
  }
  frame["transform_matrix"] = std::move(matrix);
  return frame;
}

}  // namespace

ExportFiles WriteNerfstudio(const ExportedRig& rig) {
  const auto is_fisheye = [](const ExportedCamera& camera) {
    return camera.intrinsics.model == DistortionModel::kFisheye;
  };
  auto frames = nlohmann::ordered_json::array();
  for (const ExportedCamera& camera : rig.cameras) {
    if (is_fisheye(camera) != is_fisheye(rig.cameras.front())) {
      return CannotHold(camera,
                        "nerfstudio has one lens model for all cameras of a file, and of this rig "
                        "some are fisheye and some are not");
    }
    RIGCAL_ASSIGN_OR_RETURN(nlohmann::ordered_json frame, FrameOf(camera));
    frames.push_back(std::move(frame));
  }
  const bool fisheye = !rig.cameras.empty() && is_fisheye(rig.cameras.front());
  const nlohmann::ordered_json json = {{"camera_model", fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
                                       {"frames", std::move(frames)}};
  return std::vector<ExportFile>{{"transforms.json", json.dump(2) + "\n"}};
}

}  // namespace rigcal
