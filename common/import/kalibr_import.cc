// SPDX-License-Identifier: Apache-2.0
// kalibr's camchain: cam0, cam1, ... with poses in the chain (T_cn_cnm1) and, after a calibration
// with an IMU, in the IMU's frame (T_cam_imu), which is then the rig's.
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/import/convention.h"
#include "common/import/fitted_lens.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

int LineOf(const YAML::Node& node) { return node.Mark().line + 1; }

// Reads one camera's fields, naming file and line in every error.
class KalibrCamera {
 public:
  KalibrCamera(const std::string& path, std::string key, const YAML::Node& node)
      : path_(path), key_(std::move(key)), node_(node) {}

  absl::Status Error(const YAML::Node& where, const std::string& why) const {
    return ImportError(path_, LineOf(where), absl::StrCat(key_, " ", why));
  }

  absl::StatusOr<YAML::Node> Field(const char* name) const {
    const YAML::Node field = node_[name];
    if (!field.IsDefined() || field.IsNull()) return Error(node_, absl::StrCat("has no ", name));
    return field;
  }

  absl::StatusOr<std::string> Word(const char* name) const {
    RIGCAL_ASSIGN_OR_RETURN(const YAML::Node field, Field(name));
    if (!field.IsScalar()) return Error(field, absl::StrCat(name, " is not a word"));
    return field.Scalar();
  }

  // `node` as numbers. `count` 0: any.
  absl::StatusOr<std::vector<double>> Numbers(const YAML::Node& node, const char* name,
                                              size_t count) const {
    if (!node.IsSequence() || (count > 0 && node.size() != count)) {
      return Error(node, count > 0 ? absl::StrCat(name, " is not a list of ", count, " numbers")
                                   : absl::StrCat(name, " is not a list of numbers"));
    }
    std::vector<double> values;
    for (const YAML::Node& element : node) {
      double value = NAN;
      if (!element.IsScalar() || !YAML::convert<double>::decode(element, value) ||
          !std::isfinite(value)) {
        return Error(element, absl::StrCat(name, " has an element that is not a finite number"));
      }
      values.push_back(value);
    }
    return values;
  }

  absl::StatusOr<std::vector<double>> NumberList(const char* name, size_t count) const {
    RIGCAL_ASSIGN_OR_RETURN(const YAML::Node field, Field(name));
    return Numbers(field, name, count);
  }

  absl::StatusOr<RigidTransform> Pose(const char* name) const {
    RIGCAL_ASSIGN_OR_RETURN(const YAML::Node field, Field(name));
    if (!field.IsSequence() || field.size() != 4) {
      return Error(field, absl::StrCat(name, " is not a matrix of 4 rows"));
    }
    Eigen::Matrix4d pose;
    for (int i = 0; i < 4; ++i) {
      RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> row, Numbers(field[i], name, 4));
      pose.row(i) = Eigen::RowVector4d(row.data());
    }
    if (pose.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
      return Error(field, absl::StrCat(name, " has a last row that is not 0 0 0 1"));
    }
    const absl::StatusOr<Eigen::Quaterniond> rotation = RotationFrom(pose.topLeftCorner<3, 3>());
    if (!rotation.ok()) {
      return Error(field, absl::StrCat(name, ": ", std::string(rotation.status().message())));
    }
    return RigidTransform(*rotation, pose.topRightCorner<3, 1>());
  }

  bool Has(const char* name) const { return node_[name].IsDefined(); }
  const YAML::Node& node() const { return node_; }
  const std::string& key() const { return key_; }

 private:
  const std::string& path_;
  const std::string key_;
  const YAML::Node node_;
};

// camera_model ds: kalibr has it without distortion only, values xi, alpha, fu, fv, pu, pv.
absl::StatusOr<Intrinsics> KalibrDoubleSphere(const KalibrCamera& reader, const ImageSize& size,
                                              std::vector<std::string>* notes) {
  if (reader.Has("distortion_model")) {
    RIGCAL_ASSIGN_OR_RETURN(const std::string model, reader.Word("distortion_model"));
    if (model != "none") {
      return reader.Error(reader.node(), absl::StrCat("has the distortion_model ", model,
                                                      " beside a double sphere lens (ds), which "
                                                      "has its distortion in xi and alpha"));
    }
  }
  if (reader.Has("distortion_coeffs")) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> coefficients,
                            reader.NumberList("distortion_coeffs", 0));
    if (std::ranges::any_of(coefficients, [](double value) { return value != 0; })) {
      return reader.Error(reader.node()["distortion_coeffs"],
                          "has distortion_coeffs beside a double sphere lens (ds), which has its "
                          "distortion in xi and alpha");
    }
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> k, reader.NumberList("intrinsics", 6));
  const DoubleSphere lens{
      .xi = k[0], .alpha = k[1], .fx_px = k[2], .fy_px = k[3], .cx_px = k[4], .cy_px = k[5]};
  const absl::StatusOr<FittedLens> fitted = FitDoubleSphere(lens, size);
  if (!fitted.ok()) {
    return reader.Error(reader.node()["intrinsics"], std::string(fitted.status().message()));
  }
  notes->push_back(DoubleSphereNote(reader.key(), *fitted));
  return fitted->intrinsics;
}

absl::StatusOr<Intrinsics> KalibrIntrinsics(const KalibrCamera& reader, const ImageSize& size,
                                            std::vector<std::string>* notes) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string camera_model, reader.Word("camera_model"));
  if (camera_model == "ds") return KalibrDoubleSphere(reader, size, notes);
  if (camera_model != "pinhole") {
    const std::string known = UnreadableLensModel(camera_model);
    return reader.Error(reader.node(),
                        absl::StrCat("has the camera_model ", camera_model,
                                     known.empty() ? "; pinhole and ds can be read" : ": ", known));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> k, reader.NumberList("intrinsics", 4));
  Intrinsics intrinsics;
  intrinsics.fx_px = k[0], intrinsics.fy_px = k[1], intrinsics.cx_px = k[2],
  intrinsics.cy_px = k[3];
  RIGCAL_ASSIGN_OR_RETURN(const std::string model, reader.Word("distortion_model"));
  if (model == "none") return intrinsics;
  if (model != "radtan" && model != "equidistant") {
    return reader.Error(reader.node(), absl::StrCat("has the distortion_model ", model,
                                                    "; radtan, equidistant and none can be read"));
  }
  RIGCAL_ASSIGN_OR_RETURN(intrinsics.distortion, reader.NumberList("distortion_coeffs", 4));
  if (model == "radtan") {
    intrinsics.distortion.push_back(0);  // k3
  } else {
    intrinsics.model = DistortionModel::kFisheye;
  }
  return intrinsics;
}

// "/left/image_raw" -> "left"
std::string NameFromTopic(const std::string& topic) {
  const size_t begin = topic.find_first_not_of('/');
  const size_t end = topic.rfind('/');
  if (begin == std::string::npos || end == std::string::npos || end <= begin) return "";
  return CameraNameFrom(topic.substr(begin, end - begin));
}

// Everything but the pose. `notes`: what was done to read it.
absl::StatusOr<ImportedCamera> LensFromKalibr(const std::string& path, const KalibrCamera& reader,
                                              std::vector<std::string>* notes) {
  ImportedCamera camera;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> size, reader.NumberList("resolution", 2));
  for (const double side : size) {
    if (side >= 1 && side <= kMaxImageSidePx) continue;
    return reader.Error(reader.node()["resolution"], "has a resolution out of range");
  }
  camera.image_size_px = {static_cast<uint32_t>(size[0]), static_cast<uint32_t>(size[1])};
  RIGCAL_ASSIGN_OR_RETURN(camera.intrinsics, KalibrIntrinsics(reader, camera.image_size_px, notes));
  if (reader.Has("timeshift_cam_imu")) {
    const YAML::Node shift = reader.node()["timeshift_cam_imu"];
    if (!YAML::convert<double>::decode(shift, camera.time_offset_s) ||
        !std::isfinite(camera.time_offset_s)) {
      return reader.Error(shift, "has a timeshift_cam_imu that is not a number");
    }
  }
  camera.name = "camera";  // until it is known whether the topics are names
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, LineOf(reader.node()), camera));
  return camera;
}

// Where the chain stands: the pose of the camera before, if it is known.
struct KalibrChain {
  std::optional<RigidTransform> previous;
  std::string previous_key;
  bool begun = false;
};

// cam_from_rig; none: the camera has no pose of its own and no camera before it. A pose of another
// program's file (T_imu_cam) is not taken.
absl::StatusOr<std::optional<RigidTransform>> PoseFromKalibr(const KalibrCamera& reader,
                                                             const KalibrChain& chain) {
  if (reader.Has("T_cam_imu")) return reader.Pose("T_cam_imu");
  if (!chain.begun) return RigidTransform();
  if (!reader.Has("T_cn_cnm1")) return std::nullopt;
  RIGCAL_ASSIGN_OR_RETURN(const RigidTransform step, reader.Pose("T_cn_cnm1"));
  if (!chain.previous) {
    return reader.Error(reader.node(), absl::StrCat("has a pose relative to ", chain.previous_key,
                                                    " (T_cn_cnm1), whose own pose is not known"));
  }
  return step * *chain.previous;
}

// The numbers of cam0, cam1, ... that a file has.
std::vector<size_t> KalibrNumbers(const YAML::Node& root) {
  std::vector<size_t> numbers;
  for (const auto& field : root) {
    if (!field.first.IsScalar()) continue;
    absl::string_view key = field.first.Scalar();
    uint32_t number = 0;
    if (absl::ConsumePrefix(&key, "cam") && absl::SimpleAtoi(key, &number) &&
        absl::StrCat(number) == key) {
      numbers.push_back(number);
    }
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadKalibr(const std::string& path, const std::string& text) {
  RIGCAL_RETURN_IF_ERROR(CheckText(path, text, NestedFormat::kYaml));
  YAML::Node root;
  try {
    root = YAML::Load(WithoutYamlDirective(text));
  } catch (const YAML::Exception& exception) {
    return ImportError(path, exception.mark.line + 1, exception.msg);
  }
  const std::vector<size_t> numbers = root.IsMap() ? KalibrNumbers(root) : std::vector<size_t>();
  if (numbers.empty()) {
    return ImportError(path, 0, "is not kalibr's camchain: it has no cam0");
  }
  ImportedRig rig{"kalibr", {}, {}};
  std::vector<std::string> topics;
  KalibrChain chain;
  for (size_t i = 0; i < numbers.size(); ++i) {
    const std::string key = absl::StrCat("cam", numbers[i]);
    const std::string before = absl::StrCat("cam", numbers[i] > 0 ? numbers[i] - 1 : 0);
    const YAML::Node node = root[key];
    // A number that is missing is a gap: what hangs on it has no pose.
    if (i > 0 ? numbers[i] != numbers[i - 1] + 1 : numbers[i] != 0) {
      chain = {.previous = std::nullopt, .previous_key = before, .begun = true};
      rig.left_out.push_back(
          {before, std::string(ImportError(path, LineOf(node),
                                           absl::StrCat(before, " is missing before ", key))
                                   .message())});
    }
    if (!node.IsMap()) {
      rig.Add(key, ImportError(path, LineOf(node), key + " has no fields"));
      chain = {.previous = std::nullopt, .previous_key = key, .begun = true};
      continue;
    }
    const KalibrCamera reader(path, key, node);
    absl::StatusOr<ImportedCamera> camera = LensFromKalibr(path, reader, &rig.notes);
    const absl::StatusOr<std::optional<RigidTransform>> pose = PoseFromKalibr(reader, chain);
    chain = {.previous = pose.ok() ? *pose : std::nullopt, .previous_key = key, .begun = true};
    if (camera.ok() && !pose.ok()) camera = pose.status();
    if (camera.ok()) {
      camera->cam_from_rig = *pose;
      camera->other_name = key;
      const YAML::Node topic = node["rostopic"];
      topics.push_back(topic.IsDefined() && topic.IsScalar() ? NameFromTopic(topic.Scalar()) : "");
    }
    rig.Add(key, std::move(camera));
    if (reader.Has("T_imu_cam") && !reader.Has("T_cam_imu")) {
      rig.notes.push_back(absl::StrCat(
          key,
          ": T_imu_cam is ignored; a pose is read from T_cam_imu or from the chain T_cn_cnm1"));
    }
  }
  // Without any pose the file holds lenses; the first camera is the rig's origin for others only.
  const bool has_poses = std::any_of(numbers.begin(), numbers.end(), [&root](size_t number) {
    const YAML::Node node = root[absl::StrCat("cam", number)];
    return node.IsMap() && (node["T_cam_imu"].IsDefined() || node["T_cn_cnm1"].IsDefined());
  });
  if (!has_poses && numbers.size() > 1) {
    for (ImportedCamera& camera : rig.cameras) camera.cam_from_rig.reset();
  }
  for (size_t i = 0; i < topics.size(); ++i) rig.cameras[i].name = topics[i];
  const auto unnamed = [&] {
    for (const std::string& topic : topics) {
      if (topic.empty()) return true;
    }
    return !CheckNames(path, rig).ok();
  };
  if (unnamed()) {
    for (ImportedCamera& camera : rig.cameras) camera.name = camera.other_name;
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  RecogniseConvention(&rig);
  return rig;
}

}  // namespace rigcal
