// SPDX-License-Identifier: Apache-2.0
// MCAP with Foxglove's messages as JSON: a CameraCalibration per camera on the topic
// /CAMERA/calibration, and FrameTransforms with the pose of every camera in the rig frame on
// /tf_static. Cameras look along z with y down; pixels are OpenCV's.
#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/export/format_writers.h"
#include "common/export/foxglove_schemas.h"
#include "common/export/mcap_container.h"

namespace rigcal {
namespace {

using Json = nlohmann::ordered_json;

Json FoxgloveTime(uint64_t utc_ns) {
  return {{"sec", utc_ns / 1'000'000'000}, {"nsec", utc_ns % 1'000'000'000}};
}

std::string FoxgloveFrame(const ExportedCamera& camera) { return camera.name + "_optical_frame"; }

const char* FoxgloveModel(DistortionModel model) {
  switch (model) {
    case DistortionModel::kFisheye:
      return "kannala_brandt";
    case DistortionModel::kRational:
      return "rational_polynomial";
    case DistortionModel::kBrownConrady:
      break;
  }
  return "plumb_bob";
}

std::string CalibrationMessage(const ExportedCamera& camera, uint64_t utc_ns) {
  const Intrinsics& k = camera.intrinsics;
  const std::vector<double> matrix = {k.fx_px, 0, k.cx_px, 0, k.fy_px, k.cy_px, 0, 0, 1};
  const std::vector<double> projection = {k.fx_px, 0, k.cx_px, 0, 0, k.fy_px,
                                          k.cy_px, 0, 0,       0, 1, 0};
  const Json json = {{"timestamp", FoxgloveTime(utc_ns)},
                     {"frame_id", FoxgloveFrame(camera)},
                     {"width", camera.image_size_px.width},
                     {"height", camera.image_size_px.height},
                     {"distortion_model", FoxgloveModel(k.model)},
                     {"D", camera.Coefficients()},
                     {"K", matrix},
                     {"R", std::vector<double>{1, 0, 0, 0, 1, 0, 0, 0, 1}},
                     {"P", projection}};
  return json.dump();
}

Json TransformOf(const ExportedCamera& camera, uint64_t utc_ns) {
  const RigidTransform pose = camera.cam_from_rig.Inverse();
  const Eigen::Vector3d& t = pose.translation_m;
  const Eigen::Quaterniond q = Canonical(pose.rotation);
  return {{"timestamp", FoxgloveTime(utc_ns)},
          {"parent_frame_id", "rig"},
          {"child_frame_id", FoxgloveFrame(camera)},
          {"translation", {{"x", t.x()}, {"y", t.y()}, {"z", t.z()}}},
          {"rotation", {{"x", q.x()}, {"y", q.y()}, {"z", q.z()}, {"w", q.w()}}}};
}

}  // namespace

ExportFiles WriteMcap(const ExportedRig& rig) {
  McapContent content;
  content.time_ns = static_cast<uint64_t>(std::max<int64_t>(rig.create_utc_ns, 0));
  content.schemas = {{"foxglove.CameraCalibration", FoxgloveCameraCalibrationSchema()},
                     {"foxglove.FrameTransforms", FoxgloveFrameTransformsSchema()}};
  auto transforms = Json::array();
  for (const ExportedCamera& camera : rig.cameras) {
    transforms.push_back(TransformOf(camera, content.time_ns));
    content.messages.push_back({static_cast<uint16_t>(content.channels.size()),
                                CalibrationMessage(camera, content.time_ns)});
    content.channels.push_back({0, "/" + camera.name + "/calibration"});
  }
  content.messages.push_back({static_cast<uint16_t>(content.channels.size()),
                              Json{{"transforms", std::move(transforms)}}.dump()});
  content.channels.push_back({1, "/tf_static"});
  return std::vector<ExportFile>{{"rig.mcap", McapFile(content)}};
}

}  // namespace rigcal
