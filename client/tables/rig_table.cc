// SPDX-License-Identifier: Apache-2.0
#include "client/tables/rig_table.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

constexpr double kMillimetres = 1000;
constexpr double kMonitorDegrees = 57.29577951308232;

std::string OrDash(const std::string& text) { return text.empty() ? "-" : text; }

std::string WhoAndWhy(const v1::Activation& activation) {
  std::string text =
      activation.operator_name().empty() ? "this PC" : absl::StrCat(activation.operator_name());
  if (!activation.reason().empty()) absl::StrAppend(&text, ": ", activation.reason());
  if (activation.rollback()) absl::StrAppend(&text, " (rollback)");
  if (activation.forced()) absl::StrAppend(&text, " (forced)");
  return text;
}

const char* VerdictText(v1::CameraDifference::Verdict verdict) {
  switch (verdict) {
    case v1::CameraDifference::VERDICT_SAME:
      return "same";
    case v1::CameraDifference::VERDICT_MOVED:
      return "MOVED";
    default:
      return "cannot tell";
  }
}

std::string HowDerived(const v1::CalibrationOptions& options) {
  switch (options.kind()) {
    case v1::CalibrationOptions::KIND_REPAIR:
      return absl::StrCat("repaired ", absl::StrJoin(options.only_cameras(), ", "));
    case v1::CalibrationOptions::KIND_REFINE:
      return "refined";
    case v1::CalibrationOptions::KIND_ORIGIN:
      return "new origin";
    case v1::CalibrationOptions::KIND_SCALE:
      return "new scale";
    default:
      return options.frame() == v1::CalibrationOptions::FRAME_UNSPECIFIED ? "compared" : "frame";
  }
}

const char* MonitorModeText(v1::MonitorMode mode) {
  switch (mode) {
    case v1::MONITOR_MODE_WATCH:
      return "watch";
    case v1::MONITOR_MODE_REPAIR:
      return "repair";
    default:
      return "off";
  }
}

const char* MonitorVerdictText(v1::LiveMonitoredCamera::Verdict verdict) {
  switch (verdict) {
    case v1::LiveMonitoredCamera::VERDICT_GOOD:
      return "still good";
    case v1::LiveMonitoredCamera::VERDICT_MOVED:
      return "MOVED";
    default:
      return "cannot tell";
  }
}

}  // namespace

std::string FormatRigList(const v1::ListRigsResponse& response) {
  if (response.rigs().empty()) return "no rigs: a rig comes with its first session\n";
  TextTable table;
  table.Words({"rig", "active"}).Numbers({"version", "cameras", "calibrations"}).Words({"since"});
  for (const v1::Rig& rig : response.rigs()) {
    table.AddRow({rig.name(), OrDash(rig.active_calibration_id()),
                  rig.has_activation() ? absl::StrCat(rig.active_version()) : "-",
                  rig.has_activation() ? absl::StrCat(rig.cameras_size()) : "-",
                  rig.calibration_count(),
                  FormatTime(rig.has_activation(), rig.activation().time())});
  }
  return Printable(table.Format());
}

std::string FormatRig(const v1::Rig& rig) {
  std::string text = absl::StrCat("rig                ", rig.name(), "\n");
  if (!rig.has_activation()) {
    absl::StrAppend(&text,
                    "active             none; rigcal rig activate ID makes a calibration so\n");
  } else {
    absl::StrAppend(&text, "active             ", rig.active_calibration_id(), ", version ",
                    rig.active_version(), "\nsince              ",
                    FormatTime(true, rig.activation().time()), "\nby                 ",
                    WhoAndWhy(rig.activation()), "\ncameras            ",
                    absl::StrJoin(rig.cameras(), ", "), "\n");
  }
  absl::StrAppend(&text, "calibrations       ", rig.calibration_count(), "\n");
  absl::StrAppend(&text, "monitor            ", MonitorModeText(rig.monitor()), "\n");
  return Printable(text);
}

std::string FormatMonitor(const v1::LiveMonitor& monitor) {
  std::string text = absl::StrCat("monitor            ", MonitorModeText(monitor.mode()), "\n");
  if (monitor.mode() != v1::MONITOR_MODE_WATCH && monitor.mode() != v1::MONITOR_MODE_REPAIR) {
    return text;
  }
  absl::StrAppend(
      &text, "against            ", OrDash(monitor.calibration_id()), "\nlast look          ",
      monitor.has_time()
          ? absl::StrCat(FormatTime(true, monitor.time()), ", session ", monitor.session_id())
          : "none yet: wave",
      "\n");
  if (!monitor.problem().empty()) {
    absl::StrAppend(&text, "cannot tell        ", monitor.problem(), "\n");
  }
  if (!monitor.repair_text().empty()) {
    absl::StrAppend(&text, "repair             ", monitor.repair_text(), "\n");
  }
  TextTable table;
  table.Words({"camera", "verdict", "since"})
      .Numbers({"moved mm", "+-", "turned deg", "+-", "shift px", "sigmas", "clock ms", "+-"});
  for (const v1::LiveMonitoredCamera& camera : monitor.cameras()) {
    const bool known = camera.has_time();
    const auto number = [known](double value, int digits) {
      return known ? FormatFixed(value, digits) : std::string("-");
    };
    const bool clock = camera.clock_change_sigma_s() > 0;
    table.AddRow(
        {camera.camera(), MonitorVerdictText(camera.verdict()), FormatTime(known, camera.time()),
         number(kMillimetres * camera.translation_m(), 2),
         number(kMillimetres * camera.translation_sigma_m(), 2),
         number(kMonitorDegrees * camera.rotation_rad(), 4),
         number(kMonitorDegrees * camera.rotation_sigma_rad(), 4), number(camera.centre_px(), 2),
         number(camera.sigmas(), 1), clock ? FormatFixed(1e3 * camera.clock_change_s(), 3) : "-",
         clock ? FormatFixed(1e3 * camera.clock_change_sigma_s(), 3) : "-"});
  }
  if (!monitor.cameras().empty()) absl::StrAppend(&text, table.Format(2));
  return Printable(text);
}

std::string FormatActivation(const v1::Activation& activation) {
  std::string text =
      absl::StrCat("calibration ", activation.calibration_id(), " (version ", activation.version(),
                   ") is the active one of rig '", activation.rig(), "'");
  if (!activation.previous_calibration_id().empty()) {
    absl::StrAppend(&text, ", after ", activation.previous_calibration_id());
  }
  return Printable(text + "\n");
}

std::string FormatDerivation(const v1::Calibration& calibration) {
  const v1::CalibrationOptions& options = calibration.options();
  std::string text;
  if (options.what_if()) text += "what-if            it can never become active\n";
  if (!options.parent_id().empty()) {
    absl::StrAppend(&text, "derived from       ", options.parent_id(), " (", HowDerived(options),
                    ")\n");
  }
  if (!calibration.held().empty()) {
    absl::StrAppend(&text, "held               ", absl::StrJoin(calibration.held(), ", "), "\n");
  }
  if (!calibration.operator_name().empty()) {
    absl::StrAppend(&text, "made by            ", calibration.operator_name(), "\n");
  }
  if (!calibration.reason().empty()) {
    absl::StrAppend(&text, "reason             ", calibration.reason(), "\n");
  }
  if (!calibration.notes().empty()) {
    absl::StrAppend(&text, "notes              ", calibration.notes(), "\n");
  }
  return Printable(text);
}

std::string FormatHistory(const v1::ListActivationsResponse& response) {
  if (response.activations().empty()) return "no calibration was active yet\n";
  TextTable table;
  table.Numbers({"no."}).Words({"time", "calibration"}).Numbers({"version"}).Words({"by"});
  for (const v1::Activation& activation : response.activations()) {
    table.AddRow({activation.number(), FormatTime(true, activation.time()),
                  activation.calibration_id(), activation.version(), WhoAndWhy(activation)});
  }
  return Printable(table.Format());
}

std::string FormatPruned(const v1::PruneSessionsResponse& response, bool dry_run) {
  std::string text;
  if (response.sessions().empty()) {
    text = "no session is due\n";
  } else {
    TextTable table;
    table.Words({"session"}).Numbers({"observations"}).Words({"", "why"});
    for (const v1::PrunedSession& session : response.sessions()) {
      table.AddRow({session.id(), session.observation_count(),
                    !session.kept().empty() ? "kept"
                    : dry_run               ? "would be deleted"
                                            : "deleted",
                    session.kept().empty()
                        ? session.reason()
                        : absl::StrCat(session.reason(), ", but ", session.kept())});
    }
    text = table.Format();
  }
  absl::StrAppend(&text, "the database has ", FormatBytes(response.used_bytes()), "\n");
  return Printable(text);
}

std::string CamerasWith(const v1::CompareCalibrationsResponse& difference,
                        v1::CameraDifference::Verdict verdict) {
  std::vector<std::string> names;
  for (const v1::CameraDifference& camera : difference.cameras()) {
    if (camera.verdict() == verdict) names.push_back(camera.camera());
  }
  return absl::StrJoin(names, ", ");
}

std::string FormatDifference(const v1::CompareCalibrationsResponse& difference) {
  std::string text = absl::StrCat(difference.id_b(), " against ", difference.id_a(), ", ");
  if (difference.problem().empty()) {
    absl::StrAppend(&text, "in the frame of ", difference.id_a(), ", aligned over ",
                    absl::StrJoin(difference.frame_cameras(), ", "), "\n");
  } else {
    absl::StrAppend(&text, "aligned over all cameras: ", difference.problem(), "\n");
  }
  TextTable table;
  table.Words({"camera"})
      .Numbers({"moved", "+-"}, "centre (mm)")
      .Numbers({"turned", "+-"}, "direction (degrees)")
      .Numbers({"shift", "+-"}, "middle of volume (px)")
      .Numbers({"sigmas"})
      .Words({"verdict"});
  for (const v1::CameraDifference& camera : difference.cameras()) {
    table.AddRow({camera.camera(), FormatFixed(camera.translation_m() * kMillimetres, 3),
                  FormatFixed(camera.translation_sigma_m() * kMillimetres, 3),
                  FormatFixed(DegreesFromRadians(camera.rotation_rad()), 4),
                  FormatFixed(DegreesFromRadians(camera.rotation_sigma_rad()), 4),
                  FormatFixed(camera.centre_px(), 3), FormatFixed(camera.centre_sigma_px(), 3),
                  FormatFixed(camera.sigmas(), 1), VerdictText(camera.verdict())});
  }
  absl::StrAppend(&text, table.Format(2));
  if (!difference.only_in_a().empty()) {
    absl::StrAppend(&text, "only in ", difference.id_a(), ": ",
                    absl::StrJoin(difference.only_in_a(), ", "), "\n");
  }
  if (!difference.only_in_b().empty()) {
    absl::StrAppend(&text, "only in ", difference.id_b(), ": ",
                    absl::StrJoin(difference.only_in_b(), ", "), "\n");
  }
  return Printable(text);
}

}  // namespace rigcal::client
