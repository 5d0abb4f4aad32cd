// SPDX-License-Identifier: Apache-2.0
#include "client/tables/calibration_table.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/tables/camera_tables.h"
#include "client/tables/session_table.h"
#include "common/wire/time_wire.h"

namespace rigcal::client {
namespace {

constexpr double kMmPerM = 1000;

// "clock_offset" from "FINDING_KIND_CLOCK_OFFSET"; "unknown" for a value without a name.
std::string EnumWord(const std::string& name, absl::string_view prefix) {
  if (name.empty()) return "unknown";
  return absl::AsciiStrToLower(absl::StripPrefix(name, prefix));
}

// "searching time offsets".
std::string StageText(v1::CalibrationStage stage) {
  return absl::StrReplaceAll(EnumWord(v1::CalibrationStage_Name(stage), "CALIBRATION_STAGE_"),
                             {{"_", " "}});
}

std::string GradeName(v1::Quality::Grade grade) {
  switch (grade) {
    case v1::Quality::GRADE_GOOD:
      return "good";
    case v1::Quality::GRADE_USABLE:
      return "usable";
    case v1::Quality::GRADE_BAD:
      return "bad";
    default:
      return "not graded";
  }
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
  if (target.given().kind() == v1::Target::KIND_POINT) return "";  // has no length
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
    TextTable table(
        {{"finding"}, {"severity"}, {"camera"}, TextTable::Number("value"), {"unit"}, {"advice"}});
    for (const v1::Finding& finding : calibration.findings()) {
      table.AddRow({EnumWord(v1::FindingKind_Name(finding.kind()), "FINDING_KIND_"),
                    EnumWord(v1::FindingSeverity_Name(finding.severity()), "FINDING_SEVERITY_"),
                    finding.camera().empty() ? "(all)" : finding.camera(),
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

std::string FormatHead(const v1::Calibration& calibration) {
  std::string text =
      absl::StrCat("calibration  ", calibration.id(), " (rig ", calibration.rig(), ", version ",
                   calibration.version(), "): ", CalibrationStateName(calibration.state()), "\n");
  absl::StrAppend(&text, calibration.session_ids_size() == 1 ? "session      " : "sessions     ",
                  absl::StrJoin(calibration.session_ids(), ", "), "\n");
  return Printable(text);
}

std::string FormatResult(const v1::Calibration& calibration) {
  std::string text = "\nResiduals over the instants used, outliers included\n";
  text += FormatCameraResiduals(calibration);
  absl::StrAppend(&text, "\nCameras in the rig frame, which is the frame of ",
                  Printable(calibration.reference_camera()),
                  " (x right, y down, z forward):\n"
                  "centre, and orientation as axis times angle of rig_from_cam\n",
                  FormatCameraPoses(calibration), FormatCameraUncertainty(calibration),
                  FormatHeldOutErrors(calibration), "\n");
  absl::StrAppend(&text, "instants used      ", calibration.instant_count(), "\n",
                  FormatWand(calibration.target()));
  return text + FormatScale(calibration);
}

}  // namespace

std::string CalibrationStateName(v1::Calibration::State state) {
  switch (state) {
    case v1::Calibration::STATE_QUEUED:
      return "queued";
    case v1::Calibration::STATE_RUNNING:
      return "running";
    case v1::Calibration::STATE_SUCCEEDED:
      return "succeeded";
    case v1::Calibration::STATE_FAILED:
      return "failed";
    default:
      return absl::StrCat("state ", static_cast<int>(state));
  }
}

std::string FormatCalibrationProgress(const v1::Calibration& calibration) {
  if (calibration.state() != v1::Calibration::STATE_RUNNING) {
    return "calibration " + CalibrationStateName(calibration.state());
  }
  const double percent = std::clamp(calibration.progress().fraction(), 0.0, 1.0) * 100;
  return absl::StrCat("calibrating: ", StageText(calibration.progress().stage()), " ",
                      FormatFixed(percent, 0), " %");
}

std::string FormatCalibrationList(
    const google::protobuf::RepeatedPtrField<v1::Calibration>& calibrations) {
  if (calibrations.empty()) return "no calibrations\n";
  TextTable table({{"calibration"},
                   {"rig"},
                   TextTable::Number("version"),
                   {"state"},
                   TextTable::Number("instants"),
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
  if (calibration.state() == v1::Calibration::STATE_FAILED) {
    absl::StrAppend(&text, "error        ", Printable(calibration.error()), "\n");
  } else if (calibration.state() == v1::Calibration::STATE_RUNNING) {
    absl::StrAppend(&text, FormatCalibrationProgress(calibration), "\n");
  } else if (calibration.state() == v1::Calibration::STATE_SUCCEEDED) {
    text += FormatResult(calibration);
  }
  if (const double solve_s = wire::SecondsOf(calibration.run().solve_duration()); solve_s > 0) {
    absl::StrAppend(&text, "time taken         ", FormatDuration(solve_s), "\n");
  }
  if (!calibration.refused().empty()) {
    text += "\nLeft out\n" + FormatRefusals(calibration.refused(), 2);
  }
  text += FormatFindings(calibration);
  return text;
}

}  // namespace rigcal::client
