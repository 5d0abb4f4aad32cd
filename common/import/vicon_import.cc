// SPDX-License-Identifier: Apache-2.0
// Vicon's .xcp (Vicon's documentation, "About calibration data (XCP) files"): <Cameras><Camera
// DEVICEID SENSOR_SIZE PIXEL_ASPECT_RATIO><KeyFrames><KeyFrame ...>. POSITION is the centre of the
// camera in millimetres, ORIENTATION (x y z w) takes the room to the camera. The lens model takes
// pixels to pixels without distortion: p' = c + (p - c) (1 + k1 r^2 + k2 r^4 + ...), r in pixels.
#include <cmath>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/convention.h"
#include "common/import/fitted_lens.h"
#include "common/import/import_readers.h"
#include "common/import/xml_document.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kMetresPerMm = 0.001;
constexpr double kFittedWithinPx = 0.05;

struct ViconLens {
  Eigen::Vector2d centre_px;  // of the distortion
  std::vector<double> k;      // of r^2, r^4, ...
};

// "k1 k2", or of VICON_RADIAL2 the words "ViconRadial2 cx cy k1 k2 k3".
absl::StatusOr<ViconLens> ViconLensFrom(const XmlElement& frame, const Eigen::Vector2d& centre) {
  ViconLens lens{centre, {}};
  if (!frame.Has("VICON_RADIAL2")) {
    if (!frame.Has("VICON_RADIAL")) return lens;
    RIGCAL_ASSIGN_OR_RETURN(lens.k, frame.Numbers("VICON_RADIAL", 2));
    return lens;
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::string text, frame.Text("VICON_RADIAL2"));
  const std::vector<std::string> words = absl::StrSplit(text, ' ', absl::SkipEmpty());
  std::vector<double> values;
  for (size_t i = 1; i < words.size(); ++i) {
    double value = NAN;
    if (!absl::SimpleAtod(words[i], &value) || !std::isfinite(value)) break;
    values.push_back(value);
  }
  if (words.empty() || words[0] != "ViconRadial2" || values.size() + 1 != words.size() ||
      values.size() < 4) {
    return frame.Error("has a VICON_RADIAL2 that is not ViconRadial2 and at least 4 numbers");
  }
  lens.centre_px = {values[0], values[1]};
  lens.k.assign(values.begin() + 2, values.end());
  return lens;
}

Eigen::Vector2d WithoutDistortion(const ViconLens& lens, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d from_centre = pixel - lens.centre_px;
  const double r2 = from_centre.squaredNorm();
  double scale = 1, power = 1;
  for (const double k : lens.k) scale += k * (power *= r2);
  return lens.centre_px + scale * from_centre;
}

absl::StatusOr<RigidTransform> ViconPose(const XmlElement& frame) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> q, frame.Numbers("ORIENTATION", 4));
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> p, frame.Numbers("POSITION", 3));
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (std::abs(rotation.norm() - 1) > 1e-3) {
    return frame.Error("has an ORIENTATION that is no rotation: its length is not 1");
  }
  const Eigen::Quaterniond turn = rotation.normalized();
  return RigidTransform(turn, turn * (-kMetresPerMm * Eigen::Vector3d(p.data())));
}

absl::StatusOr<ImportedCamera> CameraFromVicon(const std::string& path, const XmlElement& element,
                                               double* worst_fit_px) {
  ImportedCamera camera;
  RIGCAL_ASSIGN_OR_RETURN(const std::string id, element.Text("DEVICEID"));
  camera.name = CameraNameFrom(id);
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> size, element.Numbers("SENSOR_SIZE", 2));
  for (const double side : size) {
    if (side >= 1 && side <= kMaxImageSidePx) continue;
    return element.Error("has a SENSOR_SIZE out of range");
  }
  camera.image_size_px = {static_cast<uint32_t>(size[0]), static_cast<uint32_t>(size[1])};
  RIGCAL_ASSIGN_OR_RETURN(const double aspect, element.Number("PIXEL_ASPECT_RATIO"));
  if (element.Has("SKEW")) {
    RIGCAL_ASSIGN_OR_RETURN(const double skew, element.Number("SKEW"));
    if (skew != 0) return element.Error("has a SKEW, which our lens models have not");
  }
  RIGCAL_ASSIGN_OR_RETURN(const XmlElement frames, element.Child("KeyFrames"));
  RIGCAL_ASSIGN_OR_RETURN(const XmlElement frame, frames.Child("KeyFrame"));
  Intrinsics& k = camera.intrinsics;
  RIGCAL_ASSIGN_OR_RETURN(k.fx_px, frame.Number("FOCAL_LENGTH"));
  k.fy_px = k.fx_px / aspect;
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> centre, frame.Numbers("PRINCIPAL_POINT", 2));
  k.cx_px = centre[0], k.cy_px = centre[1];
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, frame.line(), camera));
  RIGCAL_ASSIGN_OR_RETURN(const ViconLens lens,
                          ViconLensFrom(frame, Eigen::Vector2d(centre.data())));
  const auto ray_of = [&lens, &k](const Eigen::Vector2d& pixel) -> std::optional<Eigen::Vector3d> {
    const Eigen::Vector2d straight = WithoutDistortion(lens, pixel);
    return Eigen::Vector3d((straight.x() - k.cx_px) / k.fx_px, (straight.y() - k.cy_px) / k.fy_px,
                           1);
  };
  const absl::StatusOr<FittedLens> fit =
      FitLens(DistortionModel::kBrownConrady, camera.image_size_px, ray_of, k);
  if (!fit.ok() || fit->rms_px > kFittedWithinPx) {
    return frame.Error(absl::StrCat(
        "has a lens that ours cannot describe within ", kFittedWithinPx, " px",
        fit.ok() && std::isfinite(fit->rms_px) ? absl::StrCat("; it was ", fit->rms_px, " px")
                                               : std::string()));
  }
  *worst_fit_px = std::max(*worst_fit_px, fit->rms_px);
  k = fit->intrinsics;
  RIGCAL_ASSIGN_OR_RETURN(camera.cam_from_rig, ViconPose(frame));
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, frame.line(), camera));
  return camera;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadVicon(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlDocument document, XmlDocument::Parse(path, text));
  ImportedRig rig{"Vicon", {}, {}};
  double worst_fit_px = 0;
  for (const XmlElement& element : document.root().Children("Camera")) {
    rig.Add(element.Text("DEVICEID").value_or("without DEVICEID"),
            CameraFromVicon(path, element, &worst_fit_px));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  rig.notes.push_back(
      absl::StrCat("lenses are fitted: Vicon's model undistorts pixels, ours "
                   "distorts them; what remains is at most ",
                   worst_fit_px, " px (rms)"));
  std::vector<PoseReading> readings = CommonReadings(rig.cameras);
  // Written by others, the rotation may be that of the camera in the room, about the same centre.
  PoseReading& turned = readings.emplace_back(
      PoseReading{"the rotation is that of the camera in the room", rig.cameras});
  for (ImportedCamera& camera : turned.cameras) {
    const Eigen::Vector3d centre = camera.cam_from_rig->SourceFromTargetTranslation();
    const Eigen::Quaterniond rotation = camera.cam_from_rig->rotation.conjugate();
    camera.cam_from_rig = RigidTransform(rotation, rotation * -centre);
  }
  std::string note;
  rig.cameras = ChooseReading(std::move(readings), &note);
  if (!note.empty()) rig.notes.push_back(note);
  return rig;
}

}  // namespace rigcal
