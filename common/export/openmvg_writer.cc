// SPDX-License-Identifier: Apache-2.0
// OpenMVG's sfm_data.json ("SfM_Data container" in its documentation): one view, one intrinsic and
// one pose per camera. A pose is the rotation world to camera and the camera's centre; pixels are
// OpenCV's. The models have one focal length.
#include <cstdint>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "common/export/format_writers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

using Json = nlohmann::ordered_json;

// Marks of the serialization library (cereal, "Polymorphism" and "Smart pointers"): the first bit
// of a number says that a name or an object comes here for the first time.
constexpr uint32_t kFirstTime = 0x80000000;
constexpr uint32_t kOwnType = 0x40000000;  // of the type that is expected, not a derived one

struct OpenMvgLens {
  std::string model;
  const char* key;  // of the coefficients; null: none
  std::vector<double> coefficients;
};

absl::StatusOr<OpenMvgLens> OpenMvgLensOf(const ExportedCamera& camera) {
  if (const double error_px = SingleFocalErrorPx(camera); error_px > kHeldWithinPx) {
    return CannotHold(
        camera, absl::StrCat("OpenMVG has one focal length for both axes; of this camera they are ",
                             camera.intrinsics.fx_px, " and ", camera.intrinsics.fy_px,
                             " px, which would be ", error_px, " px wrong in the image's corners"));
  }
  const std::vector<double> k = camera.Coefficients();
  switch (camera.intrinsics.model) {
    case DistortionModel::kRational:
      return CannotHold(camera, "OpenMVG has no lens model with 8 coefficients (rational)");
    case DistortionModel::kFisheye:
      return OpenMvgLens{"fisheye", "fisheye", k};
    case DistortionModel::kBrownConrady:
      break;
  }
  if (!camera.HasDistortion()) return OpenMvgLens{"pinhole", nullptr, {}};
  return OpenMvgLens{"pinhole_brown_t2", "disto_t2", {k[0], k[1], k[4], k[2], k[3]}};
}

// Numbers of models and objects, given in the order in which they are written.
class Numbers {
 public:
  uint32_t NextObject() { return kFirstTime | ++objects_; }
  // {"polymorphic_id", "polymorphic_name"}; the name only when it comes for the first time.
  Json ModelFields(const std::string& model) {
    for (size_t i = 0; i < models_.size(); ++i) {
      if (models_[i] == model) return {{"polymorphic_id", static_cast<uint32_t>(i + 1)}};
    }
    models_.push_back(model);
    return {{"polymorphic_id", kFirstTime | static_cast<uint32_t>(models_.size())},
            {"polymorphic_name", model}};
  }

 private:
  uint32_t objects_ = 0;
  std::vector<std::string> models_;
};

Json ViewOf(const ExportedCamera& camera, uint32_t id, Numbers* numbers) {
  const Json data = {{"local_path", ""},
                     {"filename", camera.name + ".png"},
                     {"width", camera.image_size_px.width},
                     {"height", camera.image_size_px.height},
                     {"id_view", id},
                     {"id_intrinsic", id},
                     {"id_pose", id}};
  return {{"key", id},
          {"value",
           {{"polymorphic_id", kOwnType},
            {"ptr_wrapper", {{"id", numbers->NextObject()}, {"data", data}}}}}};
}

Json IntrinsicOf(const ExportedCamera& camera, const OpenMvgLens& lens, uint32_t id,
                 Numbers* numbers) {
  const Intrinsics& k = camera.intrinsics;
  Json data = {{"width", camera.image_size_px.width},
               {"height", camera.image_size_px.height},
               {"focal_length", (k.fx_px + k.fy_px) / 2},
               {"principal_point", {k.cx_px, k.cy_px}}};
  if (lens.key != nullptr) data[lens.key] = lens.coefficients;
  Json value = numbers->ModelFields(lens.model);
  value["ptr_wrapper"] = {{"id", numbers->NextObject()}, {"data", std::move(data)}};
  return {{"key", id}, {"value", std::move(value)}};
}

Json PoseOf(const ExportedCamera& camera, uint32_t id) {
  const Eigen::Matrix3d r = camera.cam_from_rig.rotation.toRotationMatrix();
  const Eigen::Vector3d c = camera.cam_from_rig.SourceFromTargetTranslation();
  auto rotation = Json::array();
  for (int i = 0; i < 3; ++i) rotation.push_back({r(i, 0), r(i, 1), r(i, 2)});
  return {{"key", id},
          {"value", {{"rotation", std::move(rotation)}, {"center", {c.x(), c.y(), c.z()}}}}};
}

}  // namespace

ExportFiles WriteOpenMvg(const ExportedRig& rig) {
  Json views = Json::array(), intrinsics = Json::array(), poses = Json::array();
  Numbers numbers;
  uint32_t id = 0;
  for (const ExportedCamera& camera : rig.cameras) views.push_back(ViewOf(camera, id++, &numbers));
  id = 0;
  for (const ExportedCamera& camera : rig.cameras) {
    RIGCAL_ASSIGN_OR_RETURN(const OpenMvgLens lens, OpenMvgLensOf(camera));
    intrinsics.push_back(IntrinsicOf(camera, lens, id, &numbers));
    poses.push_back(PoseOf(camera, id++));
  }
  const Json json = {{"sfm_data_version", "0.3"},      {"root_path", ""},
                     {"views", std::move(views)},      {"intrinsics", std::move(intrinsics)},
                     {"extrinsics", std::move(poses)}, {"structure", Json::array()},
                     {"control_points", Json::array()}};
  return std::vector<ExportFile>{{"sfm_data.json", json.dump(2) + "\n"}};
}

}  // namespace rigcal
