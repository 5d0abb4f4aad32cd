// SPDX-License-Identifier: Apache-2.0
// nerfstudio's transforms.json ("Data conventions" in its documentation): cameras look along -z
// with y up, transform_matrix is rig_from_cam, and the centre of the first pixel is (0.5, 0.5).
// OpenMVG's sfm_data.json ("SfM_Data"): views, intrinsics and poses by number; a pose is the
// rotation to the camera and the camera's centre.
#include <cmath>
#include <filesystem>
#include <map>

#include "absl/strings/str_cat.h"
#include "common/import/import_readers.h"
#include "common/import/scene_json.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

std::optional<Eigen::MatrixXd> MatrixOf(const SceneJson& rows, int row_count, int col_count) {
  if (!rows.is_array() || static_cast<int>(rows.size()) < row_count) return std::nullopt;
  Eigen::MatrixXd matrix(row_count, col_count);
  for (int i = 0; i < row_count; ++i) {
    const SceneJson& row = rows[static_cast<size_t>(i)];
    if (!row.is_array() || static_cast<int>(row.size()) != col_count) return std::nullopt;
    for (int j = 0; j < col_count; ++j) {
      const SceneJson& value = row[static_cast<size_t>(j)];
      if (!value.is_number()) return std::nullopt;
      matrix(i, j) = value.get<double>();
    }
  }
  return matrix;
}

// The name of a camera whose images are called so: "images/left.png" -> "left".
std::string NameFromImage(const std::string& image) {
  return CameraNameFrom(std::filesystem::path(image).stem().string());
}

absl::StatusOr<ImportedCamera> NerfstudioCamera(const SceneJson& file, const SceneJson& frame,
                                                const std::string& name) {
  // What a frame does not say of its lens, the file says for all.
  const auto number = [&](const char* key) {
    const std::optional<double> own = NumberAt(frame, key);
    return own ? own : NumberAt(file, key);
  };
  std::string model = TextAt(frame, "camera_model");
  if (model.empty()) model = TextAt(file, "camera_model");
  ImportedCamera camera;
  camera.name = name;
  RIGCAL_RETURN_IF_ERROR(SetSize(number("w"), number("h"), &camera));
  const auto fx = number("fl_x"), fy = number("fl_y"), cx = number("cx"), cy = number("cy");
  if (!fx || !cx || !cy) return absl::InvalidArgumentError("has no fl_x, cx or cy");
  Intrinsics& k = camera.intrinsics;
  k.fx_px = *fx, k.fy_px = fy.value_or(*fx), k.cx_px = *cx - 0.5, k.cy_px = *cy - 0.5;
  const auto value = [&](const char* key) { return number(key).value_or(0); };
  if (model == "OPENCV_FISHEYE") {
    k.model = DistortionModel::kFisheye;
    k.distortion = {value("k1"), value("k2"), value("k3"), value("k4")};
  } else if (model.empty() || model == "OPENCV" || model == "PINHOLE" ||
             model == "SIMPLE_PINHOLE") {
    if (value("k4") != 0) {
      return absl::InvalidArgumentError("has a fourth radial coefficient, which ours has not");
    }
    k.distortion = {value("k1"), value("k2"), value("p1"), value("p2"), value("k3")};
  } else {
    return absl::InvalidArgumentError(
        absl::StrCat("has the camera_model ", model.substr(0, 40),
                     "; OPENCV, OPENCV_FISHEYE, PINHOLE and SIMPLE_PINHOLE can be read"));
  }
  const SceneJson& rows = FieldOf(frame, "transform_matrix");
  const std::optional<Eigen::MatrixXd> pose = MatrixOf(rows, 3, 4);
  if (!pose) return absl::InvalidArgumentError("has no transform_matrix of 4 columns");
  Eigen::Matrix3d rotation = pose->leftCols<3>();
  rotation.rightCols<2>() = -rotation.rightCols<2>().eval();
  RIGCAL_ASSIGN_OR_RETURN(const Eigen::Quaterniond turn, RotationFrom(rotation));
  camera.cam_from_rig = RigidTransform(turn, pose->col(3)).Inverse();
  return camera;
}

absl::StatusOr<ImportedCamera> OpenMvgLens(const SceneJson& entry) {
  const SceneJson& value = FieldOf(entry, "value");
  const SceneJson& data = FieldOf(FieldOf(value, "ptr_wrapper"), "data");
  const std::string model = TextAt(value, "polymorphic_name");
  ImportedCamera camera;
  RIGCAL_RETURN_IF_ERROR(SetSize(NumberAt(data, "width"), NumberAt(data, "height"), &camera));
  const std::optional<double> focal = NumberAt(data, "focal_length");
  const SceneJson& centre = FieldOf(data, "principal_point");
  if (!focal || !centre.is_array() || centre.size() != 2 || !centre[0].is_number() ||
      !centre[1].is_number()) {
    return absl::InvalidArgumentError("has no focal_length or principal_point");
  }
  Intrinsics& k = camera.intrinsics;
  k.fx_px = k.fy_px = *focal;
  k.cx_px = centre[0].get<double>(), k.cy_px = centre[1].get<double>();
  const auto list = [&](const char* key, size_t count) {
    std::vector<double> values;
    const SceneJson& items = FieldOf(data, key);
    for (const SceneJson& item : items.is_array() ? items : SceneJson::array()) {
      if (item.is_number()) values.push_back(item.get<double>());
    }
    values.resize(count, NAN);
    return values;
  };
  if (model == "pinhole_radial_k1") {
    k.distortion = {list("disto_k1", 1)[0], 0, 0, 0, 0};
  } else if (model == "pinhole_radial_k3") {
    const std::vector<double> d = list("disto_k3", 3);
    k.distortion = {d[0], d[1], 0, 0, d[2]};
  } else if (model == "pinhole_brown_t2") {
    const std::vector<double> d = list("disto_t2", 5);
    k.distortion = {d[0], d[1], d[3], d[4], d[2]};
  } else if (model == "fisheye") {
    k.model = DistortionModel::kFisheye;
    k.distortion = list("fisheye", 4);
  } else if (model != "pinhole") {
    return absl::InvalidArgumentError(absl::StrCat("has the lens model ", model.substr(0, 40),
                                                   ", which is none that rigcal has"));
  }
  return camera;
}

absl::StatusOr<ImportedCamera> OpenMvgCamera(const std::map<double, SceneJson>& lenses,
                                             const std::map<double, SceneJson>& poses,
                                             const SceneJson& view, const std::string& name) {
  const auto lens = lenses.find(NumberAt(view, "id_intrinsic").value_or(-1));
  if (lens == lenses.end()) return absl::InvalidArgumentError("has no intrinsic");
  RIGCAL_ASSIGN_OR_RETURN(ImportedCamera camera, OpenMvgLens(lens->second));
  camera.name = name;
  const auto pose = poses.find(NumberAt(view, "id_pose").value_or(-1));
  if (pose == poses.end()) return camera;
  const SceneJson& value = FieldOf(pose->second, "value");
  const std::optional<Eigen::MatrixXd> rotation = MatrixOf(FieldOf(value, "rotation"), 3, 3);
  const std::optional<Eigen::MatrixXd> centre =
      MatrixOf(SceneJson::array({FieldOf(value, "center")}), 1, 3);
  if (!rotation || !centre) return absl::InvalidArgumentError("has a pose without values");
  RIGCAL_ASSIGN_OR_RETURN(const Eigen::Quaterniond turn, RotationFrom(Eigen::Matrix3d(*rotation)));
  camera.cam_from_rig = RigidTransform(turn, turn * -Eigen::Vector3d(centre->transpose()));
  return camera;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadNerfstudio(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const SceneJson json, SceneOf(path, text));
  ImportedRig rig{"nerfstudio", {}, {}};
  const SceneJson& frames = FieldOf(json, "frames");
  if (!frames.is_array()) return ImportError(path, 0, "has frames that are no list");
  for (const SceneJson& frame : frames) {
    std::string name = NameFromImage(TextAt(frame, "file_path"));
    if (name.empty()) name = absl::StrCat("frame", rig.cameras.size() + rig.left_out.size());
    rig.Add(name, PlacedCamera(path, name, NerfstudioCamera(json, frame, name)));
  }
  return FinishedRig(path, std::move(rig));
}

absl::StatusOr<ImportedRig> ReadOpenMvg(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const SceneJson json, SceneOf(path, text));
  std::map<double, SceneJson> lenses, poses;
  std::map<double, std::string> models;  // by number: only the first of a kind has the name
  for (const SceneJson& entry : FieldOf(json, "intrinsics")) {
    SceneJson named = entry;
    if (!FieldOf(entry, "value").is_object()) continue;
    constexpr uint32_t kFirstTimeBit = 0x80000000;
    const double id = NumberAt(FieldOf(entry, "value"), "polymorphic_id").value_or(0);
    const double number = id >= kFirstTimeBit ? id - kFirstTimeBit : id;
    const std::string name = TextAt(FieldOf(entry, "value"), "polymorphic_name");
    if (!name.empty()) models[number] = name;
    named["value"]["polymorphic_name"] = models[number];
    lenses[NumberAt(entry, "key").value_or(-1)] = std::move(named);
  }
  for (const SceneJson& entry : FieldOf(json, "extrinsics")) {
    poses[NumberAt(entry, "key").value_or(-1)] = entry;
  }
  ImportedRig rig{"OpenMVG", {}, {}};
  for (const SceneJson& entry : FieldOf(json, "views")) {
    const SceneJson& view = FieldOf(FieldOf(FieldOf(entry, "value"), "ptr_wrapper"), "data");
    std::string name = NameFromImage(TextAt(view, "filename"));
    if (name.empty()) name = absl::StrCat("view", rig.cameras.size() + rig.left_out.size());
    rig.Add(name, PlacedCamera(path, name, OpenMvgCamera(lenses, poses, view, name)));
  }
  return FinishedRig(path, std::move(rig));
}

}  // namespace rigcal
