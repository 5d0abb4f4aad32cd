// SPDX-License-Identifier: Apache-2.0
#include "tests/common/import/imported_texts.h"

#include <Eigen/Geometry>
#include <numbers>

#include "absl/strings/str_format.h"

namespace rigcal::testing {
namespace {

std::string RotationText(const Eigen::Matrix3d& r) {
  std::string text;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      absl::StrAppendFormat(&text, " r%d%d=\"%.12f\"", i + 1, j + 1, r(i, j));
  }
  return text;
}

std::string LensText(const ImportedCamera& camera, double unit, double last) {
  const Intrinsics& k = camera.intrinsics;
  const std::vector<double>& d = k.distortion;
  return absl::StrFormat(
      "<intrinsic focallength=\"9\" sensorMinU=\"0\" sensorMaxU=\"%.6f\" sensorMinV=\"0\" "
      "sensorMaxV=\"%.6f\"\n focalLengthU=\"%.9f\" focalLengthV=\"%.9f\" centerPointU=\"%.9f\" "
      "centerPointV=\"%.9f\" skew=\"0\"\n radialDistortion1=\"%.9f\" radialDistortion2=\"%.9f\" "
      "radialDistortion3=\"%.9f\" tangentalDistortion1=\"%.9f\" tangentalDistortion2=\"%.9f\"/>\n",
      camera.image_size_px.width * unit - last, camera.image_size_px.height * unit - last,
      k.fx_px * unit, k.fy_px * unit, k.cx_px * unit, k.cy_px * unit, d[0], d[1], d[4], d[2], d[3]);
}

std::string CalibrationText(const std::vector<ImportedCamera>& cameras, bool theia) {
  std::string text = "<?xml version=\"1.0\"?>\n<calibration created=\"2024\">\n<cameras>\n";
  for (const ImportedCamera& camera : cameras) {
    const RigidTransform& pose = *camera.cam_from_rig;
    Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    Eigen::Vector3d vector = 1000 * pose.translation_m;
    if (!theia) {
      rotation.row(1) *= -1;  // y up
      rotation.row(2) *= -1;  // looks along -z
      vector = 1000 * pose.SourceFromTargetTranslation();
    }
    absl::StrAppendFormat(&text,
                          "<camera active=\"1\" serial=\"%s\" viewrotation=\"0\">\n<transform "
                          "x=\"%.9f\" y=\"%.9f\" z=\"%.9f\"%s/>\n%s</camera>\n",
                          camera.name, vector.x(), vector.y(), vector.z(), RotationText(rotation),
                          LensText(camera, theia ? 1 : 64, theia ? 0 : 1));
  }
  return text + "</cameras>\n</calibration>\n";
}

}  // namespace

std::vector<ImportedCamera> RingOfCameras(int count, const std::vector<double>& distortion) {
  std::vector<ImportedCamera> cameras;
  for (int i = 0; i < count; ++i) {
    ImportedCamera& camera = cameras.emplace_back();
    camera.name = std::to_string(101 + i);
    camera.image_size_px = {1920, 1088};
    camera.intrinsics.fx_px = 1500 + i;
    camera.intrinsics.fy_px = 1500 + i;
    camera.intrinsics.cx_px = 955.25;
    camera.intrinsics.cy_px = 548.5;
    camera.intrinsics.distortion = distortion;
    const double angle = 2 * std::numbers::pi * i / count;
    const Eigen::Vector3d target(0.5, 0.2, 1);
    const Eigen::Vector3d centre =
        target + 3 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.4).normalized();
    Eigen::Matrix3d rotation;  // rows: right, down, forward
    rotation.row(2) = (target - centre).normalized();
    rotation.row(0) = Eigen::Vector3d(rotation.row(2)).cross(Eigen::Vector3d::UnitZ()).normalized();
    rotation.row(1) = Eigen::Vector3d(rotation.row(2)).cross(Eigen::Vector3d(rotation.row(0)));
    camera.cam_from_rig = RigidTransform(Eigen::Quaterniond(rotation), -(rotation * centre));
  }
  return cameras;
}

std::string QtmText(const std::vector<ImportedCamera>& cameras) {
  return CalibrationText(cameras, false);
}

std::string TheiaText(const std::vector<ImportedCamera>& cameras) {
  return CalibrationText(cameras, true);
}

std::string ViconText(const std::vector<ImportedCamera>& cameras, double k1, double k2) {
  std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<Cameras VERSION=\"1.0\">\n";
  for (const ImportedCamera& camera : cameras) {
    const Eigen::Quaterniond& q = camera.cam_from_rig->rotation;
    const Eigen::Vector3d centre = 1000 * camera.cam_from_rig->SourceFromTargetTranslation();
    const Intrinsics& k = camera.intrinsics;
    absl::StrAppendFormat(
        &text,
        "  <Camera DEVICEID=\"%s\" PIXEL_ASPECT_RATIO=\"1\" SENSOR_SIZE=\"%d %d\" SKEW=\"0\">\n"
        "    <KeyFrames>\n      <KeyFrame FOCAL_LENGTH=\"%.9f\" ORIENTATION=\"%.12f %.12f %.12f "
        "%.12f\" POSITION=\"%.9f %.9f %.9f\" PRINCIPAL_POINT=\"%.9f %.9f\" VICON_RADIAL=\"%.15g "
        "%.15g\"/>\n    </KeyFrames>\n  </Camera>\n",
        camera.name, camera.image_size_px.width, camera.image_size_px.height, k.fx_px, q.x(), q.y(),
        q.z(), q.w(), centre.x(), centre.y(), centre.z(), k.cx_px, k.cy_px, k1, k2);
  }
  return text + "</Cameras>\n";
}

}  // namespace rigcal::testing
