// SPDX-License-Identifier: Apache-2.0
#include "client/tables/calibration_table.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/tables/frame_table.h"
#include "client/tables/notable_cameras.h"
#include "client/tables/rig_table.h"
#include "client/tables/session_table.h"
#include "common/geometry/rigid_transform.h"
#include "common/wire/camera_wire.h"
#include "common/wire/time_wire.h"

namespace rigcal::client {
namespace {

constexpr double kMmPerM = 1000;
constexpr double kMsPerS = 1000;
constexpr double kUsPerS = 1e6;

std::string GradeName(v1::Quality::Grade grade) {
  return grade == v1::Quality::GRADE_UNSPECIFIED ? "not graded" : EnumWord(grade);
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
  uint64_t count = 0;
  for (const v1::SpanError& span : target.spans()) count += span.count();
  std::string text = "wand length error  ";
  if (count == 0 && target.length_error_rms_m() == 0) return text + "not measured\n";
  absl::StrAppend(&text, FormatFixed(target.length_error_rms_m() * kMmPerM, 3), " mm rms");
  if (count > 0) absl::StrAppend(&text, " over ", FormatCount(count, "span"));
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

// Where static points were found.
std::string FormatStaticPoints(const v1::CalibratedTarget& target, bool metric) {
  TextTable table;
  table.Words({"static point"})
      .Numbers({"x", "y", "z"}, metric ? "position (m)" : "position (unknown scale)")
      .Numbers({"cameras"});
  for (const v1::CalibratedPoint& point : target.static_points()) {
    std::vector<TextTable::Cell> cells = {point.label()};
    for (const double x : wire::FromProto(point.position_m())) {
      cells.push_back(FormatFixed(x, metric ? 4 : 5));
    }
    cells.push_back(point.camera_count());
    table.AddRow(cells);
  }
  return table.empty() ? "" : table.Format(2);
}

// What it is, where it was seen, if that is not all sessions, and what was found of it.
std::string FormatTarget(const v1::CalibratedTarget& target, bool metric) {
  const v1::Target::Kind kind = target.given().kind();
  const bool all_sessions = target.session_ids().empty();
  // The usual ones go without saying.
  if (all_sessions && kind == v1::Target::KIND_POINT) return "";
  if (all_sessions && kind == v1::Target::KIND_WAND) return FormatWand(target);
  const bool is_static = kind == v1::Target::KIND_STATIC;
  std::string text = absl::StrCat("target             ", EnumWord(kind));
  if (target.given().points_size() > 0) {
    absl::StrAppend(&text, ", ", FormatCount(target.given().points_size(), "point"));
  }
  if (is_static) absl::StrAppend(&text, ", ", target.static_points_size(), " placed");
  if (target.marker_positions_estimated() && kind == v1::Target::KIND_RIGID) {
    text += " (estimated)";
  }
  if (!all_sessions) {
    absl::StrAppend(&text, is_static ? ", seen in " : ", waved in ",
                    absl::StrJoin(target.session_ids(), ", "));
  }
  const bool has_lengths = kind == v1::Target::KIND_RIGID || target.given().surveyed();
  if (has_lengths) {
    absl::StrAppend(&text, "; one sigma of the scale ",
                    FormatFixed(100 * target.scale_sigma_rel(), 3), " %");
  }
  text = Printable(text + "\n");
  if (is_static) {
    text += "                   (what does not move says nothing of the cameras' clocks)\n";
    text += FormatStaticPoints(target, metric);
  }
  return kind == v1::Target::KIND_WAND ? text + FormatWand(target) : text;
}

std::string FormatTargets(const v1::Calibration& calibration) {
  std::string text = FormatTarget(calibration.target(), calibration.scale_known());
  for (const v1::CalibratedTarget& other : calibration.other_targets()) {
    text += FormatTarget(other, calibration.scale_known());
  }
  return text;
}

// The usual one goes without saying.
std::string FormatSolver(const v1::Calibration& calibration) {
  return calibration.solver_path() == v1::SOLVER_PATH_GENERAL
             ? "solver             general path (Ceres)\n"
             : "";
}

// So does interpolation.
std::string FormatTrajectory(const v1::Calibration& calibration) {
  const v1::CalibratedTrajectory& trajectory = calibration.trajectory();
  std::string text;
  if (trajectory.kind() == v1::CalibratedTrajectory::KIND_SPLINE) {
    text = absl::StrFormat(
        "trajectory         spline, knots every %.1f ms, jerk density %.3g m/s^2.5, "
        "%d rows that no other camera shares\n",
        1e3 * trajectory.knot_spacing_s(), trajectory.jerk_density(), trajectory.added_row_count());
  } else if (calibration.options().trajectory() == v1::CalibrationOptions::TRAJECTORY_SPLINE &&
             trajectory.kind() == v1::CalibratedTrajectory::KIND_INTERPOLATED) {
    text =
        "trajectory         interpolated, NOT the spline that was asked for: the target was "
        "placed\n"
        "                   too rarely, the recording is too long, or it has several wands\n";
  }
  if (trajectory.held_out_spline_px() > 0) {
    absl::StrAppendFormat(&text, "held out           %.3f px interpolated, %.3f px with a spline\n",
                          trajectory.held_out_interpolated_px(), trajectory.held_out_spline_px());
  }
  return text;
}

std::string FormatFindings(const v1::Calibration& calibration) {
  std::string text;
  if (!calibration.findings().empty()) {
    TextTable table;
    table.Words({"finding", "severity", "camera"}).Numbers({"value"}).Words({"unit", "advice"});
    for (const v1::Finding& finding : calibration.findings()) {
      table.AddRow({v1::FindingKind_IsValid(finding.kind())
                        ? EnumWord(finding.kind())
                        : absl::StrCat("unknown kind ", static_cast<int>(finding.kind())),
                    finding.candidate() ? "candidate" : EnumWord(finding.severity()),
                    finding.camera().empty() ? "(all)" : finding.camera(),
                    FormatMagnitude(finding.value()), finding.unit(), finding.advice()});
    }
    text = "\nFindings\n" + table.Format(2);
  }
  return text;
}

double Norm(const v1::Vector3& vector) {
  return Eigen::Vector3d(vector.x(), vector.y(), vector.z()).norm();
}

std::string FormatCameraResiduals(const v1::Calibration& calibration) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"observations", "markers", "outliers"})
      .Numbers({"mean", "rms"}, "of the markers used (px)")
      .Numbers({"mean", "rms", "median", "p95"}, "with outliers (px)");
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    const v1::Residuals& residuals = camera.residuals();
    const auto& all = residuals.all();
    const auto& inlier = residuals.inlier();
    table.AddRow({camera.camera(), residuals.observation_count(), all.marker_count(),
                  residuals.outlier_count(), FormatFixed(inlier.mean_px(), 3),
                  FormatFixed(inlier.rms_px(), 3), FormatFixed(all.mean_px(), 3),
                  FormatFixed(all.rms_px(), 3), FormatFixed(all.median_px(), 3),
                  FormatFixed(all.p95_px(), 3)});
  }
  return table.Format(2);
}

// Centres and orientations in the rig frame, and the clocks.
std::string FormatCameraPoses(const v1::Calibration& calibration) {
  const bool metric = calibration.scale_known();
  TextTable table;
  table.Words({"camera"})
      .Numbers({"x", "y", "z"}, metric ? "position (m)" : "position (unknown scale)")
      .Numbers({"x", "y", "z"}, "rotation vector (deg)")
      .Numbers({"offset (ms)", "rate (ppm)"}, "time");
  const auto& cameras = calibration.cameras();
  const bool any_rolls =
      std::ranges::any_of(cameras, [](const auto& c) { return c.line_delay_s() != 0; });
  if (any_rolls) table.Numbers({"delay (us)", "sigma"}, "image row");
  const bool all_estimated =
      std::ranges::all_of(cameras, &v1::CalibratedCamera::time_offset_estimated);
  const bool any_courses =
      std::ranges::any_of(cameras, [](const auto& c) { return c.clock_course_size() > 0; });
  for (const v1::CalibratedCamera& camera : cameras) {
    std::vector<TextTable::Cell> cells = {camera.camera()};
    const absl::StatusOr<RigidTransform> cam_from_rig = wire::FromProto(camera.cam_from_rig());
    if (cam_from_rig.ok()) {
      const RigidTransform rig_from_cam = cam_from_rig->Inverse();
      const Eigen::AngleAxisd turn(rig_from_cam.rotation);
      const Eigen::Vector3d rotation = turn.angle() * turn.axis();
      for (const double x : rig_from_cam.translation_m) {
        cells.push_back(FormatFixed(x, metric ? 4 : 5));
      }
      for (const double x : rotation) cells.push_back(FormatFixed(DegreesFromRadians(x), 3));
    } else {
      cells.insert(cells.end(), 6, "-");
    }
    const char* mark = "*";
    if (camera.time_offset_estimated()) mark = all_estimated && !any_courses ? "" : " ";
    if (camera.clock_course_size() > 0) mark = "~";
    cells.push_back(FormatFixed(camera.time_offset_s() * kMsPerS, 3) + mark);
    cells.push_back(FormatFixed(camera.time_rate_ppm(), 2));
    if (any_rolls) {
      const bool has_sigma = camera.line_delay_sigma_s() > 0;  // not where it is held at its limit
      cells.push_back(camera.line_delay_s() != 0 ? FormatFixed(camera.line_delay_s() * kUsPerS, 3)
                                                 : "-");
      cells.push_back(has_sigma ? FormatFixed(camera.line_delay_sigma_s() * kUsPerS, 3) : "-");
    }
    table.AddRow(cells);
  }
  std::string text = table.Format(2);
  if (!all_estimated) {
    text += "  * as aligned beforehand, not estimated from the images\n";
  }
  if (any_courses) {
    text += "  ~ in the beginning: the clock jumped or drifted, and is followed (see findings)\n";
  }
  return text;
}

// One sigma of each pose and clock, with a headline; empty where there is none.
std::string FormatCameraUncertainty(const v1::Calibration& calibration) {
  const bool metric = calibration.scale_known();
  TextTable table;
  table.Words({"camera"})
      .Numbers({metric ? "position (mm)" : "position (unknown scale)", "rotation (deg)",
                "time offset (ms)"},
               "one sigma");
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
  const std::string gauge =
      calibration.reference_camera().empty()
          ? ", that of the frame included"
          : absl::StrCat(", with ", Printable(calibration.reference_camera()), " held fixed");
  return absl::StrCat("\nUncertainty", gauge, "\n", table.Format(2));
}

// Errors on what was not used for the solve, with a headline; empty where there are none.
std::string FormatHeldOutErrors(const v1::Calibration& calibration) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"mean", "rms", "p95"}, "held-out error (px)")
      .Numbers({"mean", "rms", "p95"}, "left-out error (px)");
  for (const v1::CalibratedCamera& camera : calibration.cameras()) {
    if (!camera.has_held_out() && !camera.has_leave_one_out()) continue;
    std::vector<TextTable::Cell> cells = {camera.camera()};
    for (const auto& [is_set, figures] :
         {std::pair(camera.has_held_out(), &camera.held_out()),
          std::pair(camera.has_leave_one_out(), &camera.leave_one_out())}) {
      for (const double value_px : {figures->mean_px(), figures->rms_px(), figures->p95_px()}) {
        cells.push_back(is_set ? FormatFixed(value_px, 3) : "-");
      }
    }
    table.AddRow(cells);
  }
  if (table.empty()) return "";
  return "\nErrors on observations kept out of the solve (held out), and of each camera against "
         "the\n"
         "others alone (left out)\n" +
         table.Format(2);
}

std::string FormatHead(const v1::Calibration& calibration) {
  return Printable(absl::StrCat(
      "calibration  ", calibration.id(), " (rig ", calibration.rig(), ", version ",
      calibration.version(), "): ", EnumWord(calibration.state()),
      calibration.progress().waiting().empty() ? "" : "; ", calibration.progress().waiting(),
      calibration.session_ids_size() == 1 ? "\nsession      " : "\nsessions     ",
      calibration.session_ids().empty() ? std::string("none")
                                        : absl::StrJoin(calibration.session_ids(), ", "),
      "\n"));
}

// The grade, the figures beside it, and why it is no better.
std::string FormatHeadline(const v1::Calibration& calibration) {
  std::string text;
  const v1::Quality& quality = calibration.quality();
  if (quality.grade() != v1::Quality::GRADE_UNSPECIFIED) {
    absl::StrAppend(&text, "\nQuality: ", GradeName(quality.grade()), "\n");
    for (const std::string& reason : quality.reasons()) {
      absl::StrAppend(&text, "  ", Printable(reason), "\n");
    }
  }
  if (const std::string figures = FormatHeadlineFigures(calibration); !figures.empty()) {
    absl::StrAppend(&text, "\n", figures);
  }
  return text;
}

std::string FormatResult(const v1::Calibration& calibration) {
  return absl::StrCat(
      "\nReprojection errors over the instants used\n", FormatCameraResiduals(calibration),
      "\nCameras in the rig frame",
      calibration.reference_camera().empty()
          ? std::string(" (below)")
          : absl::StrCat(", which is the frame of ", Printable(calibration.reference_camera()),
                         " (x right, y down, z forward)"),
      ":\n"
      "centre, and orientation as axis times angle of rig_from_cam\n",
      FormatCameraPoses(calibration), FormatCameraUncertainty(calibration),
      FormatHeldOutErrors(calibration), "\ninstants used      ", calibration.instant_count(), "\n",
      FormatTargets(calibration), FormatScale(calibration), FormatSolver(calibration),
      FormatTrajectory(calibration), calibration.has_frame() ? FormatFrame(calibration) : "",
      FormatScaleSources(calibration));
}

// What the expected error is below almost certainly, a line of its own.
std::string BoundWords(const v1::Headline& headline) {
  if (!(headline.point_error_bound_m() > 0)) return "";  // of an older release
  return absl::StrCat("                   ", FormatPointError(headline.point_error_bound_m(), 0),
                      " at most, with a probability of 95 %\n");
}

// What makes most of the expected error, a line of its own.
std::string BasisWords(v1::Headline::ErrorBasis basis) {
  switch (basis) {
    case v1::Headline::ERROR_BASIS_COVARIANCE:
      return "                   from the covariance: the noise of the data\n";
    case v1::Headline::ERROR_BASIS_LENSES:
      return "                   from the change with the lenses: those given were kept, and are "
             "off\n";
    case v1::Headline::ERROR_BASIS_FOLDS:
      return "                   from the folds: parts of the data differ by more than their "
             "noise\n";
    default:
      return "";
  }
}

std::string StateWords(const v1::Calibration& calibration) {
  return absl::StrCat(EnumWord(calibration.state()),
                      calibration.progress().not_responding() ? ", not responding" : "");
}

// `summary`: of the cameras, a line; empty: none.
std::string FormatCalibrationWith(const v1::Calibration& calibration, const std::string& summary) {
  std::string text = FormatHead(calibration) + FormatDerivation(calibration);
  if (calibration.state() == v1::Calibration::STATE_FAILED) {
    absl::StrAppend(&text, "error        ", Printable(calibration.error()), "\n");
  } else if (calibration.state() == v1::Calibration::STATE_RUNNING) {
    absl::StrAppend(&text, FormatCalibrationProgress(calibration), "\n");
  } else if (calibration.state() == v1::Calibration::STATE_SUCCEEDED) {
    absl::StrAppend(&text, FormatHeadline(calibration), summary, FormatResult(calibration));
  }
  if (const double solve_s = wire::SecondsOf(calibration.run().solve_duration()); solve_s > 0) {
    absl::StrAppend(&text, "time taken         ", FormatDuration(solve_s), "\n");
  }
  return text + FormatRefusals("Left out", calibration.refused()) + FormatFindings(calibration);
}

}  // namespace

std::string FormatHeadlineFigures(const v1::Calibration& calibration) {
  if (!calibration.has_headline()) return "";
  const v1::Headline& headline = calibration.headline();
  const v1::CalibratedTarget& target = calibration.target();
  std::string text;
  if (headline.point_error_m() > 0) {
    const int count = target.marker_positions_m_size();
    const std::string advice = FormatScaleAdvice(
        target.scale_sigma_rel(), count > 0 ? target.marker_positions_m(count - 1) : 0);
    // The figure believes the rows, and a bad result is one whose rows contradict it.
    const bool is_bad = calibration.quality().grade() == v1::Quality::GRADE_BAD;
    absl::StrAppend(&text, "expected error     ", is_bad ? "at least " : "",
                    FormatPointError(headline.point_error_m(), target.scale_sigma_rel()),
                    is_bad ? ": it is graded bad\n" : ", in 95 % of the waved places\n",
                    is_bad ? "" : BoundWords(headline), BasisWords(headline.point_error_basis()),
                    advice.empty() ? "" : absl::StrCat("                   ", advice, "\n"));
  }
  absl::StrAppend(&text, "reprojection error ", FormatFixed(headline.used_mean_px(), 3),
                  " px, mean of the markers used; ", FormatFixed(100 * headline.unused_share(), 1),
                  " % of the views not used\n");
  return text;
}

std::string FormatCalibrationProgress(const v1::Calibration& calibration) {
  const v1::CalibrationProgress& progress = calibration.progress();
  if (calibration.state() != v1::Calibration::STATE_RUNNING) {
    return absl::StrCat("calibration ", EnumWord(calibration.state()),
                        progress.waiting().empty() ? "" : ": ", progress.waiting());
  }
  const double percent = std::clamp(calibration.progress().fraction(), 0.0, 1.0) * 100;
  // "searching time offsets".
  const std::string stage =
      absl::StrReplaceAll(EnumWord(calibration.progress().stage()), {{"_", " "}});
  return absl::StrCat("calibrating: ", stage, " ", FormatFixed(percent, 0), " %",
                      progress.not_responding() ? ", not responding" : "",
                      progress.solved_by().empty() ? "" : ", by ", progress.solved_by(),
                      progress.waiting().empty() ? "" : "; ", progress.waiting());
}

std::string FormatCalibrationList(const v1::ListCalibrationsResponse& response) {
  if (response.calibrations().empty()) return "no calibrations\n";
  TextTable table;
  table.Words({"calibration", "rig"})
      .Numbers({"version"})
      .Words({"state"})
      .Numbers({"instants"})
      .Words({"quality", "created", "sessions"});
  for (const v1::Calibration& calibration : response.calibrations()) {
    table.AddRow({calibration.id(), calibration.rig(), calibration.version(),
                  StateWords(calibration), calibration.instant_count(),
                  GradeName(calibration.quality().grade()),
                  FormatTime(calibration.run().has_create_time(), calibration.run().create_time()),
                  absl::StrJoin(calibration.session_ids(), ", ")});
  }
  std::string text = table.Format();
  for (const v1::Calibration& calibration : response.calibrations()) {
    if (!calibration.damage().empty()) {
      absl::StrAppend(&text, "damaged  ", Printable(calibration.damage()), "\n");
    }
  }
  return text;
}

std::string FormatCalibration(const v1::Calibration& calibration) {
  v1::Calibration notable = calibration;
  const std::string summary = KeepNotableCameras(&notable);
  return FormatCalibrationWith(notable, summary);
}

std::string FormatWholeCalibration(const v1::Calibration& calibration) {
  return FormatCalibrationWith(calibration, "");
}

}  // namespace rigcal::client
