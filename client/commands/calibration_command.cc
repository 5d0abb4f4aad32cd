// SPDX-License-Identifier: Apache-2.0
#include "client/commands/calibration_command.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/commands/fetch_calibration.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "client/results/calibration_comparison.h"
#include "client/results/calibration_export.h"
#include "client/results/calibration_import.h"
#include "client/tables/calibration_table.h"
#include "client/tables/frame_table.h"
#include "client/tables/residual_table.h"
#include "common/export/undistorted.h"

namespace rigcal::client {
namespace {

using CalibrationStub = v1::CalibrationService::Stub;

absl::StatusOr<v1::Calibration> FetchCalibration(ServerConnection& server, const std::string& id) {
  return CalibrationOf(server.CallWithId(&CalibrationStub::GetCalibration, id));
}

// Of the server, or from a file: an exported calibration.json, or another program's.
absl::StatusOr<v1::Calibration> FetchOrImport(ServerConnection& server, const std::string& which,
                                              CommandContext& context) {
  if (!IsImportPath(which)) return FetchCalibration(server, which);
  absl::StatusOr<CalibrationFile> file = FetchCalibrationFile(which, context);
  if (!file.ok()) return file.status();
  return std::move(file->calibration);
}

// `left_out`: what people are told of cameras that are not in the files.
void PrintCalibrationFiles(const std::string& id, const std::vector<std::filesystem::path>& files,
                           const std::vector<LensNote>& lens_notes, CommandContext& context,
                           const std::vector<std::string>& left_out = {}) {
  for (const LensNote& note : lens_notes) {
    context.console.Message(absl::StrCat(
        "camera ", note.camera, ": its lens is refitted to what the format can say, up to ",
        FormatFixed(note.error_px, 3), " px off in the image"));
  }
  if (context.console.format == OutputFormat::kTable) {
    for (const std::filesystem::path& file : files) context.console.out << file.string() << "\n";
    return;
  }
  auto names = nlohmann::ordered_json::array();
  for (const std::filesystem::path& file : files) names.push_back(file.string());
  nlohmann::ordered_json answer = {{"calibration", id}, {"files", names}};
  if (!left_out.empty()) answer["left_out"] = left_out;
  for (const LensNote& note : lens_notes) answer["lens_error_px"][note.camera] = note.error_px;
  context.console.out << JsonText(answer) << "\n";
}

constexpr double kMmPerM = 1000;
constexpr std::chrono::milliseconds kAccuracyTimeout{60'000};  // a fine grid takes its time

std::string Millimetres(double metres) { return FormatFixed(metres * kMmPerM, 3); }

std::string FormatPoint(const v1::Vector3& point) {
  return absl::StrCat("(", FormatFixed(point.x(), 3), ", ", FormatFixed(point.y(), 3), ", ",
                      FormatFixed(point.z(), 3), ")");
}

std::string FormatPoints(const v1::GetAccuracyResponse& accuracy) {
  TextTable table;
  table.Words({"point (m)"})
      .Numbers({"cameras"})
      .Numbers({"x", "y", "z"}, "one sigma (mm)")
      .Numbers({"total", "without scale", "noise alone"}, "in all (mm)");
  for (const v1::PointAccuracy& point : accuracy.points()) {
    std::vector<TextTable::Cell> cells = {FormatPoint(point.point_m()), point.camera_count()};
    if (point.has_sigma_m()) {
      const v1::Vector3& sigma = point.sigma_m();
      const v1::Vector3& noise = point.noise_sigma_m();
      for (const double value_m :
           {sigma.x(), sigma.y(), sigma.z(), point.total_m(), point.shape_total_m(),
            std::hypot(noise.x(), noise.y(), noise.z())}) {
        cells.push_back(Millimetres(value_m));
      }
    } else {
      cells.insert(cells.end(), 6, "-");
    }
    table.AddRow(cells);
  }
  return table.Format(2);
}

std::string FormatSummary(const v1::GetAccuracyResponse& accuracy) {
  TextTable table;
  table.Words({""})
      .Numbers({"median", "p95", "worst"}, "expected error (mm)")
      .Words({"worst at (m)"});
  const auto add = [&table](const char* name, const v1::AccuracySummary& summary) {
    table.AddRow({name, Millimetres(summary.median_m()), Millimetres(summary.p95_m()),
                  Millimetres(summary.worst_m()), FormatPoint(summary.worst_point_m())});
  };
  add("without the scale's", accuracy.shape());
  add("with the scale's", accuracy.with_scale());
  return table.Format(2);
}

}  // namespace

ExitCode ListCalibrations(const ListOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(ReadAllPages(server, &CalibrationStub::ListCalibrations, options),
                      FormatCalibrationList);
}

ExitCode GetCalibration(const CalibrationGetOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(FetchCalibration(server, options.id),
                      options.all ? FormatWholeCalibration : FormatCalibration);
}

ExitCode CancelCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(CalibrationOf(server.CallWithId(&CalibrationStub::CancelCalibration, id)),
                      FormatCalibration);
}

ExitCode DeleteCalibration(const CalibrationDeleteOptions& options, CommandContext& context) {
  const std::string& id = options.id;
  ServerConnection server(context.server);
  if (!options.yes) {
    const absl::Status there = FetchCalibration(server, id).status();
    // One that is damaged can be deleted.
    if (!there.ok() && !absl::IsDataLoss(there)) return context.Fail(there);
    const ExitCode sure = Confirm(context.console, absl::StrCat("delete calibration ", id));
    if (sure != ExitCode::kOk) return sure;
  }
  return context.Show(server.CallWithId(&CalibrationStub::DeleteCalibration, id), [&](const auto&) {
    return Printable(absl::StrCat("calibration ", id, " is deleted\n"));
  });
}

ExitCode ExportCalibration(const CalibrationExportOptions& options, CommandContext& context) {
  ServerConnection server(context.server);
  absl::StatusOr<v1::Calibration> calibration = FetchCalibration(server, options.id);
  if (!calibration.ok()) return context.Fail(calibration.status());
  if (options.undistorted) *calibration = Undistorted(*std::move(calibration));
  if (options.output == "-") {
    if (absl::Status status = CheckHasResult(*calibration); !status.ok()) {
      return context.Fail(status);
    }
    CalibrationFile file{*std::move(calibration), {}};
    if (!options.undistorted) file.camera_covariance = FetchCovariance(server, options.id);
    context.console.out << CalibrationText(file) << std::flush;
    return ExitCode::kOk;
  }
  const auto format = FindCalibrationExportFormat(options.format);
  if (!format.ok()) return context.Fail(format.status());
  std::vector<LensNote> lens_notes;
  const bool whole = options.format == "json" && !options.undistorted;
  const auto files = whole ? WriteJsonExport(*calibration, FetchCovariance(server, options.id),
                                             options.output, nullptr, options.force)
                           : WriteExport(**format, *calibration, options.output, options.options,
                                         &lens_notes, options.force);
  if (!files.ok()) return context.Fail(files.status());
  PrintCalibrationFiles(options.id, *files, lens_notes, context);
  return ExitCode::kOk;
}

ExitCode ConvertCalibration(const CalibrationImportOptions& options, CommandContext& context) {
  absl::StatusOr<CalibrationImport> imported = ImportCalibration(options.path, options.units);
  if (!imported.ok()) return context.Fail(imported.status());
  for (const std::string& message : imported->Messages()) {
    context.console.Message(absl::StrCat(options.path, ": ", message));
  }
  v1::Calibration& calibration = imported->calibration;
  if (options.undistorted) calibration = Undistorted(std::move(calibration));
  const auto format = FindCalibrationExportFormat(options.format);
  if (!format.ok()) return context.Fail(format.status());
  if (imported->lenses_only && !(*format)->lenses_alone) {
    absl::Status status = CheckHasPoses(options.path, *imported);
    return context.Fail(absl::Status(status.code(), absl::StrCat(std::string(status.message()),
                                                                 "; --format opencv and --format "
                                                                 "ros write lenses alone")));
  }
  if (imported->lenses_only) {
    context.console.Message(absl::StrCat(options.path, ": has no poses; lenses alone are written"));
  }
  std::vector<LensNote> lens_notes;
  const auto files = WriteExport(**format, calibration, options.output, options.options,
                                 &lens_notes, options.force);
  if (!files.ok()) return context.Fail(files.status());
  PrintCalibrationFiles(options.path, *files, lens_notes, context, imported->left_out);
  const bool complete = imported->left_out.empty() && imported->doubts.empty();
  return complete ? ExitCode::kOk : ExitCode::kIncomplete;
}

ExitCode CompareCalibrations(const CalibrationPair& ids, CommandContext& context) {
  ServerConnection server(context.server);
  const absl::StatusOr<v1::Calibration> a = FetchOrImport(server, ids.a, context);
  if (!a.ok()) return context.Fail(a.status());
  const absl::StatusOr<v1::Calibration> b = FetchOrImport(server, ids.b, context);
  if (!b.ok()) return context.Fail(b.status());
  return context.Show(Compare(*a, *b), FormatComparison);
}

absl::StatusOr<v1::Vector3> ParsePoint(const std::string& text) {
  const std::vector<std::string> parts = absl::StrSplit(text, ',');
  double values[3] = {};
  bool valid = parts.size() == 3;
  for (size_t i = 0; valid && i < 3; ++i) {
    valid = absl::SimpleAtod(absl::StripAsciiWhitespace(parts[i]), &values[i]) &&
            std::isfinite(values[i]);
  }
  if (!valid) {
    return absl::InvalidArgumentError(absl::StrCat(
        "point \"", text, "\" is not three numbers: metres in the rig frame, as in 0.5,-0.2,3"));
  }
  v1::Vector3 point;
  point.set_x(values[0]);
  point.set_y(values[1]);
  point.set_z(values[2]);
  return point;
}

// The parts of the error, the one that no choice of a frame can change first.
std::string FormatErrorParts(const v1::GetAccuracyResponse& accuracy) {
  if (accuracy.calibration_p95_m() <= 0) return "";
  return absl::StrCat("shape of the rig   ", Millimetres(accuracy.calibration_rms_m()),
                      " mm (exact centres, after the best alignment, at the right scale); ",
                      Millimetres(accuracy.calibration_p95_m()),
                      " mm or less in 95 % of the points below\n", "scale              ",
                      FormatFixed(100 * accuracy.scale_sigma_rel(), 3), " % of every length\n",
                      "rig frame          ", Millimetres(accuracy.frame_rms_m()),
                      " mm (all points move together with the reference camera's own pose)\n",
                      "centres' noise     ", Millimetres(accuracy.noise_rms_m()),
                      " mm (centres good to ", FormatFixed(accuracy.sigma_px(), 2), " px)\n\n");
}

// The headline is that of the calibration: this command's own points are others.
std::string FormatAccuracy(const v1::GetAccuracyResponse& accuracy,
                           const v1::Calibration& calibration) {
  std::string text = FormatHeadlineFigures(calibration);
  if (!text.empty()) text += "\n";
  absl::StrAppend(&text, "Parts of the error of triangulated points, one sigma\n",
                  FormatErrorParts(accuracy));
  absl::StrAppend(&text, "In the frame of the reference camera, with centres good to ",
                  FormatFixed(accuracy.sigma_px(), 2), " px\n");
  if (accuracy.points_size() > 0) absl::StrAppend(&text, FormatPoints(accuracy), "\n");
  if (accuracy.grid_step_m() > 0) {
    absl::StrAppend(&text, "Over ", FormatCount(accuracy.shape().count(), "point"),
                    " that two cameras see, on a grid of ",
                    FormatFixed(accuracy.grid_step_m() * kMmPerM, 0), " mm where the wand was\n");
  } else {
    absl::StrAppend(&text, "Over these points\n");
  }
  if (accuracy.shape().count() == 0) return text + "  none is seen by two cameras\n";
  absl::StrAppend(&text, FormatSummary(accuracy));
  if (accuracy.calibration_p95_m() <= 0) {
    absl::StrAppend(&text, "scale              ", FormatFixed(100 * accuracy.scale_sigma_rel(), 3),
                    " % of every length\n");
  }
  return text;
}

ExitCode ShowAccuracy(const AccuracyCommandOptions& options, CommandContext& context) {
  v1::GetAccuracyRequest request;
  request.set_id(options.id);
  request.set_grid_step_m(options.grid_step_m);
  request.set_sigma_px(options.sigma_px);
  for (const std::string& text : options.points) {
    const absl::StatusOr<v1::Vector3> point = ParsePoint(text);
    if (!point.ok()) return context.Fail(point.status());
    *request.add_points_m() = *point;
  }
  ServerConnection server(context.server);
  const auto accuracy = server.Call(&CalibrationStub::GetAccuracy, request, kAccuracyTimeout);
  const auto calibration = accuracy.ok() ? FetchCalibration(server, options.id)
                                         : absl::StatusOr<v1::Calibration>(v1::Calibration());
  return context.Show(accuracy, [&](const v1::GetAccuracyResponse& response) {
    return FormatAccuracy(response, calibration.ok() ? *calibration : v1::Calibration());
  });
}

ExitCode ExplainCalibration(const std::string& id, CommandContext& context) {
  ServerConnection server(context.server);
  return context.Show(server.CallWithId(&CalibrationStub::ExplainCalibration, id),
                      [](const v1::ExplainCalibrationResponse& response) {
                        return FormatInformation(response.id(), response.information());
                      });
}

ExitCode ShowResiduals(const ResidualCommandOptions& options, CommandContext& context) {
  v1::GetResidualsRequest request;
  request.set_id(options.id);
  request.set_camera(options.camera);
  ServerConnection server(context.server);
  const auto residuals = server.Call(&CalibrationStub::GetResiduals, request);
  const auto calibration = residuals.ok() ? FetchCalibration(server, options.id)
                                          : absl::StatusOr<v1::Calibration>(v1::Calibration());
  return context.Show(residuals, [&](const v1::GetResidualsResponse& response) {
    return FormatResiduals(response, calibration.ok() ? *calibration : v1::Calibration());
  });
}

}  // namespace rigcal::client
