// SPDX-License-Identifier: Apache-2.0
// caliscope's camera_array.toml: tables [cameras.0], [cameras.1], ...; anipose's and Pose2Sim's
// calibration.toml: a table for each camera beside [metadata]. The fields of a camera are the same.
// Pose2Sim names the tables as its user does: [cam_0], [int_cam01_img], [gopro_top].
#include <toml++/toml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/import/convention.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

int LineOfToml(const toml::node& node) { return static_cast<int>(node.source().begin.line); }

class TomlCamera {
 public:
  TomlCamera(const std::string& path, std::string key, const toml::table& table)
      : path_(path), key_(std::move(key)), table_(table) {}

  absl::Status Error(const toml::node& where, const std::string& why) const {
    return ImportError(path_, LineOfToml(where), absl::StrCat("camera ", key_, " ", why));
  }

  absl::StatusOr<std::vector<double>> Numbers(const toml::node& node, const char* name) const {
    std::vector<double> values;
    const toml::array* const list = node.as_array();
    if (list == nullptr) return Error(node, absl::StrCat(name, " is not a list"));
    for (const toml::node& element : *list) {
      if (element.is_array()) {  // a matrix, or a column of one-element rows
        RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> row, Numbers(element, name));
        values.insert(values.end(), row.begin(), row.end());
        continue;
      }
      const std::optional<double> value = element.value<double>();
      if (!value || !std::isfinite(*value)) {
        return Error(element, absl::StrCat(name, " has an element that is not a finite number"));
      }
      values.push_back(*value);
    }
    return values;
  }

  absl::StatusOr<std::vector<double>> Field(const char* name, size_t count) const {
    const toml::node* const node = table_.get(name);
    if (node == nullptr) return Error(table_, absl::StrCat("has no ", name));
    RIGCAL_ASSIGN_OR_RETURN(std::vector<double> values, Numbers(*node, name));
    if (count > 0 && values.size() != count) {
      return Error(*node, absl::StrCat(name, " has ", values.size(), " numbers, not ", count));
    }
    return values;
  }

  const toml::table& table() const { return table_; }

 private:
  const std::string& path_;
  const std::string key_;
  const toml::table& table_;
};

absl::StatusOr<Intrinsics> TomlIntrinsics(const TomlCamera& reader) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> m, reader.Field("matrix", 9));
  Intrinsics k;
  k.fx_px = m[0], k.cx_px = m[2], k.fy_px = m[4], k.cy_px = m[5];
  if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1) {
    return reader.Error(*reader.table().get("matrix"),
                        "has a matrix that is not fx 0 cx, 0 fy cy, 0 0 1");
  }
  RIGCAL_ASSIGN_OR_RETURN(k.distortion, reader.Field("distortions", 0));
  const size_t count = k.distortion.size();
  if (reader.table()["fisheye"].value_or(false)) {
    k.model = DistortionModel::kFisheye;
  } else if (count == 8) {
    k.model = DistortionModel::kRational;
  } else if (count == 4) {
    k.distortion.push_back(0);  // k3
  }
  if (k.distortion.size() != static_cast<size_t>(CoefficientCount(k.model))) {
    return reader.Error(*reader.table().get("distortions"),
                        absl::StrCat("has ", count,
                                     " distortions; 4, 5 or 8 can be read, 4 of a "
                                     "fisheye lens"));
  }
  return k;
}

std::string NameOf(const toml::table& table, const std::string& key) {
  const toml::node* const node = table.get("name");
  if (node == nullptr) return key;
  if (const auto number = node->value_exact<int64_t>()) return std::to_string(*number);
  const std::string name = node->value_or(key);
  return name.empty() ? key : name;
}

// caliscope writes "null" where a camera has no pose.
bool HasPose(const toml::table& table, const char* field) {
  const toml::node* const node = table.get(field);
  return node != nullptr && node->value<std::string>().value_or("") != "null";
}

// Whether a table of the file is meant to be a camera, even if it lacks something.
bool IsCameraTable(const std::string& key, const toml::table& table) {
  for (const char* const field : {"matrix", "distortions", "size", "rotation", "translation"}) {
    if (table.contains(field)) return true;
  }
  return key.starts_with("cam");
}

// caliscope: by how many quarters of a turn a camera's images are turned before they are shown.
void NoteTurnedImages(const std::string& path, const toml::table& table, const std::string& name,
                      ImportedRig* rig) {
  const toml::node* const node = table.get("rotation_count");
  if (node == nullptr || node->value<double>().value_or(1) == 0) return;
  const std::string count = std::to_string(node->value<int64_t>().value_or(0));
  rig->doubts.push_back(std::string(
      ImportError(path, LineOfToml(*node),
                  absl::StrCat("camera ", name, " has rotation_count = ", count,
                               ": its images are shown turned by quarters; lens and pose are read "
                               "as those of the image as the camera records it. Compare before you "
                               "use them with turned images"))
          .message()));
}

absl::StatusOr<ImportedCamera> CameraFromToml(const std::string& path, const std::string& key,
                                              const toml::table& table) {
  const TomlCamera reader(path, key, table);
  ImportedCamera camera;
  camera.name = CameraNameFrom(NameOf(table, key));
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> size, reader.Field("size", 2));
  for (const double side : size) {
    if (!(side >= 1 && side <= kMaxImageSidePx)) {
      return reader.Error(*table.get("size"), "has a size out of range");
    }
  }
  camera.image_size_px = {static_cast<uint32_t>(size[0]), static_cast<uint32_t>(size[1])};
  RIGCAL_ASSIGN_OR_RETURN(camera.intrinsics, TomlIntrinsics(reader));
  if (HasPose(table, "rotation") || HasPose(table, "translation")) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> r, reader.Field("rotation", 0));
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> t, reader.Field("translation", 3));
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
    if (r.size() == 9) {  // older files: row by row
      matrix = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
    } else if (r.size() == 3) {
      const Eigen::Vector3d vector(r.data());
      if (vector.norm() > 0) {
        matrix = Eigen::AngleAxisd(vector.norm(), vector.normalized()).toRotationMatrix();
      }
    } else {
      return reader.Error(*table.get("rotation"), "has a rotation of neither 3 nor 9 numbers");
    }
    const absl::StatusOr<Eigen::Quaterniond> rotation = RotationFrom(matrix);
    if (!rotation.ok()) {
      return reader.Error(*table.get("rotation"),
                          absl::StrCat(": ", std::string(rotation.status().message())));
    }
    camera.cam_from_rig = RigidTransform(*rotation, Eigen::Vector3d(t.data()));
  }
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, LineOfToml(table), camera));
  return camera;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadCaliscope(const std::string& path, const std::string& text) {
  RIGCAL_RETURN_IF_ERROR(CheckText(path, text, NestedFormat::kToml));
  // toml++ 3.3 has undefined behaviour for some letters beyond ASCII where none may be; names of
  // cameras have none anyhow.
  std::string ascii = text;
  std::replace_if(
      ascii.begin(), ascii.end(), [](char c) { return static_cast<unsigned char>(c) > 0x7f; }, '_');
  toml::table root;
  try {
    root = toml::parse(ascii, path);
  } catch (const toml::parse_error& error) {
    return ImportError(path, static_cast<int>(error.source().begin.line),
                       std::string(error.description()));
  }
  const toml::table* const nested = root["cameras"].as_table();
  ImportedRig rig{nested != nullptr ? "caliscope" : "anipose", {}, {}};
  for (const auto& [name, node] : nested != nullptr ? *nested : root) {
    const std::string key(name.str());
    const toml::table* const table = node.as_table();
    if (nested == nullptr && (table == nullptr || !IsCameraTable(key, *table))) {
      if (!key.starts_with("cam")) continue;  // metadata and the like
    }
    if (table == nullptr) {
      rig.Add(key, ImportError(path, LineOfToml(node), key + " is not a table"));
      continue;
    }
    const std::string own = nested != nullptr ? "cam_" + key : key;
    absl::StatusOr<ImportedCamera> camera = CameraFromToml(path, own, *table);
    if (camera.ok()) NoteTurnedImages(path, *table, camera->name, &rig);
    rig.Add(NameOf(*table, own), std::move(camera));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  RecogniseConvention(&rig);
  return rig;
}

}  // namespace rigcal
