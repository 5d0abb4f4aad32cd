// SPDX-License-Identifier: Apache-2.0
// Qualisys' .qca.txt, an XML text: <calibration><cameras><camera serial><transform x y z r11 ...
// r33> <intrinsic>. Lengths are millimetres, pixels come in 64 parts. (x, y, z) is the camera's
// centre, and r11 to r33, row by row, takes the room to a camera that looks along -z with y up.
// Theia writes the same elements in whole pixels, and (x, y, z) as the translation of a transform
// from the room to a camera that looks along z. The coefficients are OpenCV's.
#include "absl/strings/str_cat.h"
#include "common/import/convention.h"
#include "common/import/import_readers.h"
#include "common/import/xml_document.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr double kMetresPerMillimetre = 0.001;
// No sensor has so many pixels side by side; such numbers are 64ths.
constexpr double kLargestPixelCoordinate = 16384;
constexpr double kSubpixels = 64;

struct QtmTransform {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d vector_m;
};

absl::StatusOr<QtmTransform> TransformFrom(const XmlElement& camera) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlElement element, camera.Child("transform"));
  QtmTransform transform;
  const char* const axes[] = {"x", "y", "z"};
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 3; ++i) {
    RIGCAL_ASSIGN_OR_RETURN(const double millimetres, element.Number(axes[i]));
    transform.vector_m[i] = millimetres * kMetresPerMillimetre;
    for (int j = 0; j < 3; ++j) {
      const std::string name = absl::StrCat("r", i + 1, j + 1);
      RIGCAL_ASSIGN_OR_RETURN(matrix(i, j), element.Number(name.c_str()));
    }
  }
  const absl::StatusOr<Eigen::Quaterniond> rotation = RotationFrom(matrix);
  if (!rotation.ok()) return element.Error(std::string(rotation.status().message()));
  transform.rotation = *rotation;
  return transform;
}

absl::StatusOr<ImportedCamera> CameraFromQtm(const std::string& path, const XmlElement& element) {
  ImportedCamera camera;
  RIGCAL_ASSIGN_OR_RETURN(const std::string serial, element.Text("serial"));
  camera.name = CameraNameFrom(serial);
  RIGCAL_ASSIGN_OR_RETURN(const XmlElement lens, element.Child("intrinsic"));
  const char* const names[] = {"sensorMinU",   "sensorMaxU",   "sensorMinV",
                               "sensorMaxV",   "focalLengthU", "focalLengthV",
                               "centerPointU", "centerPointV", "skew"};
  double v[9];
  for (size_t i = 0; i < 9; ++i) {
    RIGCAL_ASSIGN_OR_RETURN(v[i], lens.Number(names[i]));
  }
  if (v[8] != 0) return lens.Error("has a skew, which our lens models have not");
  const bool fine = v[1] > kLargestPixelCoordinate;
  const double unit = fine ? kSubpixels : 1;
  // The last 64th of the last pixel; Theia says the count of pixels.
  double width = (v[1] - v[0] + (fine ? 1 : 0)) / unit;
  double height = (v[3] - v[2] + (fine ? 1 : 0)) / unit;
  double left = v[0] / unit, top = v[2] / unit;
  if (const std::vector<XmlElement> view = element.Children("fov_video"); !view.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(left, view[0].Number("left"));
    RIGCAL_ASSIGN_OR_RETURN(top, view[0].Number("top"));
    RIGCAL_ASSIGN_OR_RETURN(const double right, view[0].Number("right"));
    RIGCAL_ASSIGN_OR_RETURN(const double bottom, view[0].Number("bottom"));
    width = right - left + 1, height = bottom - top + 1;
  }
  if (!(width >= 1 && width <= kMaxImageSidePx && height >= 1 && height <= kMaxImageSidePx)) {
    return lens.Error("has an image size out of range");
  }
  camera.image_size_px = {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
  Intrinsics& k = camera.intrinsics;
  k.fx_px = v[4] / unit, k.fy_px = v[5] / unit;
  k.cx_px = v[6] / unit - left, k.cy_px = v[7] / unit - top;
  for (const char* const name : {"radialDistortion1", "radialDistortion2", "tangentalDistortion1",
                                 "tangentalDistortion2", "radialDistortion3"}) {
    RIGCAL_ASSIGN_OR_RETURN(const double coefficient, lens.Number(name));
    k.distortion.push_back(coefficient);
  }
  RIGCAL_RETURN_IF_ERROR(CheckImported(path, element.line(), camera));
  return camera;
}

}  // namespace

absl::StatusOr<ImportedRig> ReadQtm(const std::string& path, const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlDocument document, XmlDocument::Parse(path, text));
  RIGCAL_ASSIGN_OR_RETURN(const XmlElement list, document.root().Child("cameras"));
  ImportedRig rig{"QTM", {}, {}};
  std::vector<QtmTransform> transforms;
  for (const XmlElement& element : list.Children("camera")) {
    absl::StatusOr<ImportedCamera> camera = CameraFromQtm(path, element);
    const absl::StatusOr<QtmTransform> transform = TransformFrom(element);
    if (camera.ok() && !transform.ok()) camera = transform.status();
    if (camera.ok()) transforms.push_back(*transform);
    rig.Add(element.Text("serial").value_or("without serial"), std::move(camera));
  }
  RIGCAL_RETURN_IF_ERROR(CheckNames(path, rig));
  std::vector<PoseReading> readings = {
      {"Qualisys': centre of the camera, which looks along -z", rig.cameras},
      {"Theia's: transform from the room to the camera", rig.cameras}};
  const Eigen::Quaterniond flip(0, 1, 0, 0);  // half a turn about x
  for (size_t i = 0; i < transforms.size(); ++i) {
    const Eigen::Quaterniond turned = flip * transforms[i].rotation;
    readings[0].cameras[i].cam_from_rig = RigidTransform(turned, turned * -transforms[i].vector_m);
    readings[1].cameras[i].cam_from_rig =
        RigidTransform(transforms[i].rotation, transforms[i].vector_m);
  }
  std::string note;
  rig.cameras = ChooseReading(std::move(readings), &note);
  if (!note.empty()) rig.notes.push_back(note);
  return rig;
}

}  // namespace rigcal
