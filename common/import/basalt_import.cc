// SPDX-License-Identifier: Apache-2.0
// Basalt's calibration.json ("Calibration" of its documentation; cereal puts it into value0): lists
// with one entry per camera. T_imu_cam is rig_from_cam with the IMU as the rig, a quaternion and
// metres; a raw time of a camera plus cam_time_offset_ns is one of the IMU's clock. The centre of
// the first pixel is (0, 0).
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/import/fitted_lens.h"
#include "common/import/import_readers.h"
#include "common/import/scene_json.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kUnitWithin = 1e-3;  // of the length of a quaternion

// Values of these names, in this order. INVALID_ARGUMENT names the first that is missing.
absl::StatusOr<std::vector<double>> ValuesOf(const SceneJson& object,
                                             std::initializer_list<const char*> names) {
  std::vector<double> values;
  for (const char* const name : names) {
    const std::optional<double> value = NumberAt(object, name);
    if (!value) return absl::InvalidArgumentError(absl::StrCat("has no finite number ", name));
    values.push_back(*value);
  }
  return values;
}

absl::StatusOr<Intrinsics> BasaltLens(const SceneJson& entry, const ImageSize& size,
                                      const std::string& name, std::vector<std::string>* notes) {
  const std::string type = TextAt(entry, "camera_type");
  const SceneJson& given = FieldOf(entry, "intrinsics");
  const auto is_known = {"ds", "kb4", "pinhole", "pinhole-radtan8"};
  if (std::ranges::find(is_known, type) == is_known.end()) {
    const std::string known = UnreadableLensModel(type);
    return absl::InvalidArgumentError(absl::StrCat(
        "has the camera_type ", type.substr(0, 40),
        known.empty() ? "; ds, kb4, pinhole and pinhole-radtan8 can be read" : ": ", known));
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> k, ValuesOf(given, {"fx", "fy", "cx", "cy"}));
  Intrinsics lens{.fx_px = k[0], .fy_px = k[1], .cx_px = k[2], .cy_px = k[3], .distortion = {}};
  if (type == "kb4") {
    lens.model = DistortionModel::kFisheye;
    RIGCAL_ASSIGN_OR_RETURN(lens.distortion, ValuesOf(given, {"k1", "k2", "k3", "k4"}));
  } else if (type == "pinhole-radtan8") {
    lens.model = DistortionModel::kRational;
    RIGCAL_ASSIGN_OR_RETURN(lens.distortion,
                            ValuesOf(given, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}));
  } else if (type == "ds") {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> spheres, ValuesOf(given, {"xi", "alpha"}));
    for (const char* const other : {"k1", "k2", "k3", "k4", "p1", "p2"}) {
      if (NumberAt(given, other).value_or(0) == 0) continue;
      return absl::InvalidArgumentError(
          absl::StrCat("has ", other,
                       " beside a double sphere lens (ds), which has its distortion "
                       "in xi and alpha"));
    }
    const absl::StatusOr<FittedLens> fitted = FitDoubleSphere(
        {spheres[0], spheres[1], lens.fx_px, lens.fy_px, lens.cx_px, lens.cy_px}, size);
    RIGCAL_RETURN_IF_ERROR(fitted.status());
    notes->push_back(DoubleSphereNote(name, *fitted));
    return fitted->intrinsics;
  }
  return lens;
}

absl::StatusOr<RigidTransform> BasaltPose(const SceneJson& pose) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> p,
                          ValuesOf(pose, {"px", "py", "pz", "qw", "qx", "qy", "qz"}));
  const Eigen::Quaterniond rotation(p[3], p[4], p[5], p[6]);
  if (!(std::abs(rotation.norm() - 1) <= kUnitWithin)) {
    return absl::InvalidArgumentError("has a T_imu_cam whose quaternion is not of length 1");
  }
  return RigidTransform(rotation.normalized(), Eigen::Vector3d(p.data())).Inverse();
}

// Entry `i` of a list of the calibration; null where there is none.
const SceneJson& EntryOf(const SceneJson& calibration, const char* list, size_t i) {
  const SceneJson& entries = FieldOf(calibration, list);
  return entries.is_array() && i < entries.size() ? entries[i] : FieldOf(entries, "");
}

absl::StatusOr<ImportedCamera> BasaltCamera(const SceneJson& calibration, size_t i,
                                            const std::string& name,
                                            std::vector<std::string>* notes) {
  ImportedCamera camera;
  camera.name = name;
  const SceneJson& size = EntryOf(calibration, "resolution", i);
  const auto side = [&size](size_t k) -> std::optional<double> {
    if (!size.is_array() || size.size() != 2 || !size[k].is_number()) return std::nullopt;
    return size[k].get<double>();
  };
  RIGCAL_RETURN_IF_ERROR(SetSize(side(0), side(1), &camera));
  RIGCAL_ASSIGN_OR_RETURN(camera.intrinsics, BasaltLens(EntryOf(calibration, "intrinsics", i),
                                                        camera.image_size_px, name, notes));
  if (const SceneJson& pose = EntryOf(calibration, "T_imu_cam", i); !pose.is_null()) {
    RIGCAL_ASSIGN_OR_RETURN(camera.cam_from_rig, BasaltPose(pose));
  }
  camera.time_offset_s = 1e-9 * NumberAt(calibration, "cam_time_offset_ns").value_or(0);
  return camera;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadBasalt(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const SceneJson json, SceneOf(path, text));
  const SceneJson& calibration = FieldOf(json, "value0");
  const SceneJson& lenses = FieldOf(calibration, "intrinsics");
  if (!lenses.is_array()) return ImportError(path, 0, "has a value0 without a list of intrinsics");
  ImportedRig rig{"Basalt", {}, {}};
  for (size_t i = 0; i < lenses.size(); ++i) {
    const std::string name = absl::StrCat("cam", i);
    rig.Add(name, PlacedCamera(path, name, BasaltCamera(calibration, i, name, &rig.notes)));
  }
  return FinishedRig(path, std::move(rig));
}

}  // namespace rigcal
