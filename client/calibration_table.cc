// SPDX-License-Identifier: Apache-2.0
#include "client/calibration_table.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/console.h"
#include "client/quantities.h"
#include "client/session_table.h"
#include "client/text_table.h"
#include "common/geometry/rigid_transform.h"
#include "common/wire/camera_wire.h"

namespace rigcal::client {
namespace {

using Align = TextTable::Align;

constexpr double kMmPerM = 1000;
constexpr double kMsPerS = 1000;

std::string GradeName(v1::Quality::Grade grade) {
  switch (grade) {
    case v1::Quality::GOOD:
      return "good";
    case v1::Quality::USABLE:
      return "usable";
    case v1::Quality::BAD:
      return "bad";
    default:
      return "not judged";
  }
}

TextTable::Column Number(std::string head, std::string group = "") {
  return {std::move(head), Align::kRight, std::move(group)};
}

std::string FormatResiduals(const v1::Calibration& calibration) {
  TextTable table({{"camera"},
                   Number("observations"),
                   Number("markers"),
                   Number("outliers"),
                   Number("mean", "reprojection error (px)"),
                   Number("rms", "reprojection error (px)"),
                   Number("median", "reprojection error (px)"),
                   Number("p95", "reprojection error (px)"),
                   Number("mean", "of inliers (px)"),
                   Number("rms", "of inliers (px)")});
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    const v1::Residuals& residuals = camera.residuals();
    table.AddRow({camera.camera(), absl::StrCat(residuals.observation_count()),
                  absl::StrCat(residuals.marker_count()), absl::StrCat(residuals.outlier_count()),
                  FormatFixed(residuals.mean_px(), 3), FormatFixed(residuals.rms_px(), 3),
                  FormatFixed(residuals.median_px(), 3), FormatFixed(residuals.p95_px(), 3),
                  FormatFixed(residuals.inlier().mean_px(), 3),
                  FormatFixed(residuals.inlier().rms_px(), 3)});
  }
  return table.Format(2);
}

std::string FormatPoses(const v1::Calibration& calibration) {
  const std::string position =
      calibration.scale_known() ? "position (m)" : "position (unknown scale)";
  const std::string orientation = "rotation vector (deg)";
  TextTable table({{"camera"},
                   Number("x", position),
                   Number("y", position),
                   Number("z", position),
                   Number("x", orientation),
                   Number("y", orientation),
                   Number("z", orientation),
                   Number("offset (ms)", "time"),
                   Number("rate (ppm)", "time")});
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

double Norm(const v1::Vector3& vector) {
  return Eigen::Vector3d(vector.x(), vector.y(), vector.z()).norm();
}

std::string FormatUncertainty(const v1::Calibration& calibration) {
  const bool metric = calibration.scale_known();
  TextTable table({{"camera"},
                   Number(metric ? "position (mm)" : "position (unknown scale)", "one sigma"),
                   Number("rotation (deg)", "one sigma"),
                   Number("time offset (ms)", "one sigma")});
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (!camera.has_uncertainty()) continue;
    const v1::CameraUncertainty& sigma = camera.uncertainty();
    const double position = Norm(sigma.position_sigma_m());
    table.AddRow({camera.camera(),
                  metric ? FormatFixed(position * kMmPerM, 3) : FormatFixed(position, 6),
                  FormatFixed(DegreesFromRadians(Norm(sigma.rotation_sigma_rad())), 4),
                  FormatFixed(sigma.time_offset_sigma_s() * kMsPerS, 3)});
  }
  if (table.empty()) return "";
  return absl::StrCat("\nUncertainty, with ", Printable(calibration.reference_camera()),
                      " held fixed\n", table.Format(2));
}

// Errors on what was not used for the solve.
std::string FormatHeldOut(const v1::Calibration& calibration) {
  TextTable table({{"camera"},
                   Number("mean", "held-out error (px)"),
                   Number("rms", "held-out error (px)"),
                   Number("p95", "held-out error (px)"),
                   Number("mean", "left-out error (px)"),
                   Number("rms", "left-out error (px)"),
                   Number("p95", "left-out error (px)")});
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

// Where a target of one marker has its lengths from.
std::string FormatScale(const v1::Calibration& calibration) {
  if (!calibration.scale_known()) {
    std::string text = "scale              NOT KNOWN: no length here is in metres";
    if (!calibration.unit_camera().empty()) {
      absl::StrAppend(&text, ";\n                   the unit is the distance from ",
                      calibration.reference_camera(), " to ", calibration.unit_camera());
    }
    return Printable(text + "\n");
  }
  if (!calibration.options().has_known_distance()) return "";
  const v1::KnownDistance& known = calibration.options().known_distance();
  return Printable(
      absl::StrCat("scale              from the distance of ", known.camera_a(), " and ",
                   known.camera_b(), ", ", FormatFixed(known.distance_m(), 4), " m, one sigma ",
                   FormatFixed(100 * calibration.target().scale_sigma_rel(), 3), " %\n"));
}

std::string FormatWand(const v1::CalibratedTarget& target) {
  if (target.given().kind() == v1::Target::POINT) return "";  // has no length
  uint64_t count = 0;
  for (const v1::SpanError& span : target.spans()) count += span.count();
  std::string text = "wand length error  ";
  if (count == 0 && target.length_error_rms_m() == 0) {
    return text + "not measured\n";
  }
  absl::StrAppend(&text, FormatFixed(target.length_error_rms_m() * kMmPerM, 3), " mm rms");
  if (count > 0) absl::StrAppend(&text, " over ", FormatCount(count, "span", "spans"));
  text += "\n";
  for (const v1::SpanError& span : target.spans()) {
    absl::StrAppend(&text, "  span of ", FormatFixed(span.length_m() * kMmPerM, 1),
                    " mm: ", FormatFixed(span.error_rms_m() * kMmPerM, 3), " mm rms, mean ",
                    span.mean_error_m() > 0 ? "+" : "",
                    FormatFixed(span.mean_error_m() * kMmPerM, 3), " mm\n");
  }
  if (target.marker_positions_estimated()) {
    absl::StrAppend(&text, "marker positions   ",
                    absl::StrJoin(target.marker_positions_m(), ", ",
                                  [](std::string* out, double position_m) {
                                    absl::StrAppend(out, FormatFixed(position_m * kMmPerM, 3));
                                  }),
                    " mm (estimated)\n");
  }
  return text;
}

std::string FormatFindings(const v1::Calibration& calibration) {
  std::string text;
  if (!calibration.findings().empty()) {
    TextTable table({{"finding"}, {"camera"}, Number("value"), {"unit"}, {"advice"}});
    for (const v1::Finding& finding : calibration.findings()) {
      table.AddRow({finding.kind(), finding.camera().empty() ? "(all)" : finding.camera(),
                    absl::StrFormat("%.4g", finding.value()), finding.unit(), finding.advice()});
    }
    text = "\nFindings\n" + table.Format(2);
  }
  const v1::Quality& quality = calibration.quality();
  if (quality.grade() != v1::Quality::GRADE_UNSPECIFIED) {
    absl::StrAppend(&text, "\nQuality: ", GradeName(quality.grade()), "\n");
    for (const std::string& reason : quality.reasons()) {
      absl::StrAppend(&text, "  ", Printable(reason), "\n");
    }
  }
  return text;
}

std::string FormatTruth(const v1::TruthComparison& truth) {
  TextTable table({{"camera"},
                   Number("position (mm)", "error"),
                   Number("rotation (deg)", "error"),
                   Number("time offset (ms)", "error")});
  for (const v1::CameraTruthError& camera : truth.cameras()) {
    table.AddRow({camera.camera(), FormatFixed(camera.position_error_m() * kMmPerM, 3),
                  FormatFixed(camera.rotation_error_deg(), 4),
                  FormatFixed(camera.time_offset_error_s() * kMsPerS, 3)});
  }
  table.AddRow({"largest", FormatFixed(truth.max_position_error_m() * kMmPerM, 3),
                FormatFixed(truth.max_rotation_error_deg(), 4), ""});
  std::string how = "rigid alignment of the camera positions";
  if (truth.unit_length_m() > 0) {
    how = absl::StrCat("the similarity that fits the camera positions best: the\n",
                       "scale is not known, and its unit taken as ",
                       FormatFixed(truth.unit_length_m(), 4), " m");
  }
  return absl::StrCat("\nAgainst the truth, after ", how, "\n", table.Format(2));
}

std::string FormatHead(const v1::Calibration& calibration) {
  std::string text =
      absl::StrCat("calibration  ", calibration.id(), " (rig ", calibration.rig(), ", version ",
                   calibration.version(), "): ", CalibrationStateName(calibration.state()), "\n");
  absl::StrAppend(&text, calibration.session_ids_size() == 1 ? "session      " : "sessions     ",
                  absl::StrJoin(calibration.session_ids(), ", "), "\n");
  if (!calibration.parent_id().empty()) {
    absl::StrAppend(&text, "derived from ", calibration.parent_id(), "\n");
  }
  return Printable(text);
}

std::string FormatResult(const v1::Calibration& calibration) {
  std::string text = "\nResiduals over the instants used, outliers included\n";
  text += FormatResiduals(calibration);
  absl::StrAppend(&text, "\nCameras in the rig frame, which is the frame of ",
                  Printable(calibration.reference_camera()),
                  " (x right, y down, z forward):\n"
                  "centre, and orientation as axis times angle of rig_from_cam\n",
                  FormatPoses(calibration), FormatUncertainty(calibration),
                  FormatHeldOut(calibration), "\n");
  absl::StrAppend(&text, "instants used      ", calibration.instant_count(), "\n",
                  FormatWand(calibration.target()));
  return text + FormatScale(calibration);
}

}  // namespace

std::string CalibrationStateName(v1::Calibration::State state) {
  switch (state) {
    case v1::Calibration::QUEUED:
      return "queued";
    case v1::Calibration::RUNNING:
      return "running";
    case v1::Calibration::SUCCEEDED:
      return "succeeded";
    case v1::Calibration::FAILED:
      return "failed";
    default:
      return absl::StrCat("state ", static_cast<int>(state));
  }
}

std::string FormatCalibrationProgress(const v1::Calibration& calibration) {
  if (calibration.state() != v1::Calibration::RUNNING) {
    return "calibration " + CalibrationStateName(calibration.state());
  }
  const double percent = std::clamp(calibration.progress().fraction(), 0.0, 1.0) * 100;
  return absl::StrCat("calibrating: ", Printable(calibration.progress().stage()), " ",
                      FormatFixed(percent, 0), " %");
}

std::string FormatCalibrationList(
    const google::protobuf::RepeatedPtrField<v1::Calibration>& calibrations) {
  if (calibrations.empty()) return "no calibrations\n";
  TextTable table({{"calibration"},
                   {"rig"},
                   Number("version"),
                   {"state"},
                   Number("instants"),
                   {"quality"},
                   {"created"},
                   {"sessions"}});
  for (const v1::Calibration& calibration : calibrations) {
    table.AddRow({calibration.id(), calibration.rig(), absl::StrCat(calibration.version()),
                  CalibrationStateName(calibration.state()),
                  absl::StrCat(calibration.instant_count()),
                  GradeName(calibration.quality().grade()),
                  FormatTime(calibration.run().has_create_time(), calibration.run().create_time()),
                  absl::StrJoin(calibration.session_ids(), ", ")});
  }
  return table.Format();
}

std::string FormatCalibration(const v1::Calibration& calibration) {
  std::string text = FormatHead(calibration);
  if (calibration.state() == v1::Calibration::FAILED) {
    absl::StrAppend(&text, "error        ", Printable(calibration.error()), "\n");
  } else if (calibration.state() == v1::Calibration::RUNNING) {
    absl::StrAppend(&text, FormatCalibrationProgress(calibration), "\n");
  } else if (calibration.state() == v1::Calibration::SUCCEEDED) {
    text += FormatResult(calibration);
  }
  if (calibration.run().duration_s() > 0) {
    absl::StrAppend(&text, "time taken         ", FormatDuration(calibration.run().duration_s()),
                    "\n");
  }
  if (!calibration.refused().empty()) {
    text += "\nLeft out\n" + FormatRefusals(calibration.refused(), 2);
  }
  text += FormatFindings(calibration);
  if (calibration.has_truth()) text += FormatTruth(calibration.truth());
  return text;
}

}  // namespace rigcal::client
