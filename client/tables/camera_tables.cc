// SPDX-License-Identifier: Apache-2.0
#include "client/tables/camera_tables.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "common/geometry/rigid_transform.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

constexpr double kMillimetresPerMetre = 1000;
constexpr double kMsPerS = 1000;

double Norm(const v1::Vector3& vector) {
  return Eigen::Vector3d(vector.x(), vector.y(), vector.z()).norm();
}

}  // namespace

std::string FormatCameraResiduals(const v1::Calibration& calibration) {
  TextTable table({{"camera"},
                   TextTable::Number("observations"),
                   TextTable::Number("markers"),
                   TextTable::Number("outliers"),
                   TextTable::Number("mean", "reprojection error (px)"),
                   TextTable::Number("rms", "reprojection error (px)"),
                   TextTable::Number("median", "reprojection error (px)"),
                   TextTable::Number("p95", "reprojection error (px)"),
                   TextTable::Number("mean", "of inliers (px)"),
                   TextTable::Number("rms", "of inliers (px)")});
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    const v1::Residuals& residuals = camera.residuals();
    table.AddRow(
        {camera.camera(), absl::StrCat(residuals.observation_count()),
         absl::StrCat(residuals.all().marker_count()), absl::StrCat(residuals.outlier_count()),
         FormatFixed(residuals.all().mean_px(), 3), FormatFixed(residuals.all().rms_px(), 3),
         FormatFixed(residuals.all().median_px(), 3), FormatFixed(residuals.all().p95_px(), 3),
         FormatFixed(residuals.inlier().mean_px(), 3),
         FormatFixed(residuals.inlier().rms_px(), 3)});
  }
  return table.Format(2);
}

std::string FormatCameraPoses(const v1::Calibration& calibration) {
  const std::string position =
      calibration.scale_known() ? "position (m)" : "position (unknown scale)";
  const std::string orientation = "rotation vector (deg)";
  TextTable table({{"camera"},
                   TextTable::Number("x", position),
                   TextTable::Number("y", position),
                   TextTable::Number("z", position),
                   TextTable::Number("x", orientation),
                   TextTable::Number("y", orientation),
                   TextTable::Number("z", orientation),
                   TextTable::Number("offset (ms)", "time"),
                   TextTable::Number("rate (ppm)", "time")});
  const auto& cameras = calibration.cameras();
  const bool all_estimated = std::all_of(cameras.begin(), cameras.end(), [](const auto& camera) {
    return camera.time_offset_estimated();
  });
  for (const v1::CalibratedCamera& camera : cameras) {
    std::vector<std::string> cells = {camera.camera()};
    const absl::StatusOr<RigidTransform> cam_from_rig = wire::FromProto(camera.cam_from_rig());
    if (cam_from_rig.ok()) {
      const RigidTransform rig_from_cam = cam_from_rig->Inverse();
      const Eigen::Vector3d rotation = RotationVectorRad(rig_from_cam.rotation);
      const int digits = calibration.scale_known() ? 4 : 5;
      for (int i = 0; i < 3; ++i) {
        cells.push_back(FormatFixed(rig_from_cam.translation_m[i], digits));
      }
      for (int i = 0; i < 3; ++i) {
        cells.push_back(FormatFixed(DegreesFromRadians(rotation[i]), 3));
      }
    } else {
      cells.insert(cells.end(), 6, "-");
    }
    const char* mark = all_estimated ? "" : camera.time_offset_estimated() ? " " : "*";
    cells.push_back(FormatFixed(camera.time_offset_s() * kMsPerS, 3) + mark);
    cells.push_back(FormatFixed(camera.time_rate_ppm(), 2));
    table.AddRow(std::move(cells));
  }
  std::string text = table.Format(2);
  if (!all_estimated) {
    text += "  * as aligned beforehand, not estimated from the images\n";
  }
  return text;
}

std::string FormatCameraUncertainty(const v1::Calibration& calibration) {
  const bool metric = calibration.scale_known();
  TextTable table(
      {{"camera"},
       TextTable::Number(metric ? "position (mm)" : "position (unknown scale)", "one sigma"),
       TextTable::Number("rotation (deg)", "one sigma"),
       TextTable::Number("time offset (ms)", "one sigma")});
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (!camera.has_uncertainty()) continue;
    const v1::CameraUncertainty& sigma = camera.uncertainty();
    const double position = Norm(sigma.position_sigma_m());
    table.AddRow(
        {camera.camera(),
         metric ? FormatFixed(position * kMillimetresPerMetre, 3) : FormatFixed(position, 6),
         FormatFixed(DegreesFromRadians(Norm(sigma.rotation_sigma_rad())), 4),
         FormatFixed(sigma.time_offset_sigma_s() * kMsPerS, 3)});
  }
  if (table.empty()) return "";
  return absl::StrCat("\nUncertainty, with ", Printable(calibration.reference_camera()),
                      " held fixed\n", table.Format(2));
}

std::string FormatHeldOutErrors(const v1::Calibration& calibration) {
  TextTable table({{"camera"},
                   TextTable::Number("mean", "held-out error (px)"),
                   TextTable::Number("rms", "held-out error (px)"),
                   TextTable::Number("p95", "held-out error (px)"),
                   TextTable::Number("mean", "left-out error (px)"),
                   TextTable::Number("rms", "left-out error (px)"),
                   TextTable::Number("p95", "left-out error (px)")});
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (!camera.has_held_out() && !camera.has_leave_one_out()) continue;
    std::vector<std::string> cells = {camera.camera()};
    for (const auto& [is_set, figures] :
         {std::pair(camera.has_held_out(), &camera.held_out()),
          std::pair(camera.has_leave_one_out(), &camera.leave_one_out())}) {
      for (const double value_px : {figures->mean_px(), figures->rms_px(), figures->p95_px()}) {
        cells.push_back(is_set ? FormatFixed(value_px, 3) : "-");
      }
    }
    table.AddRow(std::move(cells));
  }
  if (table.empty()) return "";
  return "\nErrors on observations kept out of the solve (held out), and of each camera against "
         "the\n"
         "others alone (left out)\n" +
         table.Format(2);
}

}  // namespace rigcal::client
