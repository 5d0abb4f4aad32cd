// SPDX-License-Identifier: Apache-2.0
#include "client/commands/triangulate_command.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "client/commands/command_parser.h"
#include "client/commands/fetch_calibration.h"
#include "client/commands/triangulate_stream.h"
#include "client/output/output.h"
#include "client/results/c3d_file.h"
#include "client/results/calibration_import.h"
#include "client/results/marker_rows.h"
#include "client/results/point_frames.h"
#include "client/results/trc_file.h"
#include "client/results/triangulation_file.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/status/status_macros.h"
#include "common/triangulate/convention_check.h"

namespace rigcal::client {
namespace {

std::string EndingOf(const TriangulateCommandOptions& options) {
  return absl::AsciiStrToLower(std::filesystem::path(options.output).extension().string());
}

absl::Status CheckEnding(const TriangulateCommandOptions& options) {
  const std::string ending = EndingOf(options);
  for (const char* const known : {"", ".csv", ".txt", ".parquet", ".trc", ".c3d"}) {
    if (ending == known) return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      options.output, ": points are written as .csv, .parquet, .trc or .c3d, not as ", ending));
}

// No marker was seen by two cameras at one moment: said with when each camera has seen any.
absl::Status CheckAnyPoint(const CalibrationResult& calibration,
                           const std::vector<CameraRows>& rows,
                           const Triangulation& triangulation) {
  const bool any = !triangulation.points.empty() || triangulation.no_ray_count > 0 ||
                   triangulation.disagree_count > 0;
  if (any) return absl::OkStatus();
  std::vector<std::string> when;
  std::optional<double> begin_s;
  for (const CameraRows& camera : rows) {
    const auto calibrated =
        std::ranges::find(calibration.cameras, camera.camera, &CalibratedCamera::camera);
    std::optional<double> first_s, last_s;
    for (const Observation& row : camera.rows) {
      if (row.VisibleCount() == 0) continue;
      last_s = 1e-9 * static_cast<double>(row.time_ns) +
               (calibrated == calibration.cameras.end() ? 0 : calibrated->time_offset_s);
      if (!first_s) first_s = last_s;
    }
    if (!first_s) {
      when.push_back(absl::StrCat(camera.camera, " no marker"));
      continue;
    }
    if (!begin_s) begin_s = first_s;
    when.push_back(absl::StrFormat("%s from %.1f to %.1f s", camera.camera, *first_s - *begin_s,
                                   *last_s - *begin_s));
  }
  return absl::FailedPreconditionError(absl::StrCat(
      "there is no point: no marker was seen by two cameras at one moment. By the clocks of the "
      "calibration there is of ",
      absl::StrJoin(when, ", of "),
      ". Are the rows of one recording, and were no clocks set anew since the calibration?"));
}

// In the format that the ending of the output names.
absl::StatusOr<std::string> PointsText(const TriangulateCommandOptions& options,
                                       const Triangulation& triangulation,
                                       const std::vector<std::string>& labels) {
  const std::string ending = EndingOf(options);
  // Its id or the name of its file: a path would name folders of this PC, and differ on another.
  const std::string calibration = std::filesystem::path(options.calibration).filename().string();
  if (ending == ".parquet") {
    return TriangulationParquet(triangulation, labels, calibration);
  }
  if (ending != ".trc" && ending != ".c3d") return TriangulationCsv(triangulation, labels);
  RIGCAL_ASSIGN_OR_RETURN(const PointFrames frames, FramesOf(triangulation, labels));
  if (ending == ".trc") {
    return TrcFile(frames, std::filesystem::path(options.output).filename().string());
  }
  return C3dFile(frames, calibration);
}

absl::StatusOr<TriangulationSummary> TriangulateFolder(const TriangulateCommandOptions& options,
                                                       CommandContext& context) {
  if (options.output != "-") {
    RIGCAL_RETURN_IF_ERROR(CheckEnding(options));
    RIGCAL_RETURN_IF_ERROR(CheckOutputFile(options.output, options.force));
  }
  if (std::error_code error; !std::filesystem::is_directory(options.data, error)) {
    return absl::NotFoundError(absl::StrCat(
        "there is no folder ", options.data,
        ": --data names the folder with <camera>.csv of each camera, and the calibration stands "
        "before it"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationFile file,
                          FetchCalibrationFile(options.calibration, context));
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : calibration.cameras) names.push_back(camera.camera);
  RIGCAL_ASSIGN_OR_RETURN(MarkerRows rows, ReadMarkerRows(options.data, names));
  for (const std::string& warning : rows.warnings) context.console.Message(warning);
  size_t marker_count = 0;
  for (const CameraRows& camera : rows.cameras) {
    marker_count = std::max(marker_count, camera.rows.front().markers.size());
  }
  TriangulationOptions triangulation_options = options.triangulation;
  triangulation_options.diameter_m =
      options.diameter_m.value_or(calibration.target.given.diameter_m);
  RIGCAL_ASSIGN_OR_RETURN(const Triangulation triangulation,
                          TriangulateRows(calibration, rows.cameras, triangulation_options));
  RIGCAL_RETURN_IF_ERROR(CheckAnyPoint(calibration, rows.cameras, triangulation));
  RIGCAL_RETURN_IF_ERROR(
      CheckConvention(calibration, rows.cameras, triangulation_options, triangulation));
  const std::vector<std::string> labels = MarkerLabels(calibration.target.given, marker_count);
  RIGCAL_ASSIGN_OR_RETURN(const std::string points, PointsText(options, triangulation, labels));
  if (options.output == "-") {
    context.console.out << points << std::flush;
  } else {
    RIGCAL_RETURN_IF_ERROR(WriteOutputFile(options.output, points));
  }
  TriangulationSummary summary = Summarise(calibration, triangulation);
  summary.calibration = options.calibration;
  summary.output = options.output;
  return summary;
}

}  // namespace

ExitCode TriangulateData(const TriangulateCommandOptions& options, CommandContext& context) {
  if (options.data == "-" && IsImportPath(options.calibration)) {
    return context.Fail(absl::InvalidArgumentError(absl::StrCat(
        options.calibration,
        " is a file, and rows that come on stdin are triangulated by the server, which "
        "has calibrations by their id; give the file with --data DIR")));
  }
  if (options.data == "-") {
    if (options.output == "-") return TriangulateLines(options, std::cin, context);
    return context.Fail(absl::InvalidArgumentError(
        "points of rows that come on stdin go to stdout: --data - goes with --output -"));
  }
  const absl::StatusOr<TriangulationSummary> summary = TriangulateFolder(options, context);
  // The points themselves have gone to stdout.
  if (summary.ok() && options.output == "-") return ExitCode::kOk;
  return context.Show(summary, FormatTriangulation);
}

void AddTriangulateCommand(CommandParser& parser) {
  auto [app, options] = parser.AddCommand(
      nullptr, "triangulate",
      "Labelled rows of a calibrated rig to points in 3-D, each with its covariance",
      TriangulateData);
  AddArgument(app, "CALIBRATION",
              "Id of a calibration, or the path (with a . or /) of an exported calibration.json or "
              "of another program's file",
              &options->calibration);
  AddOption(app, "--data", "DIR", &options->data,
            "Folder with rows: <camera>.csv (time_ns;x0;y0;x1;y1;..., -1: not seen) for each "
            "camera; - for lines with the camera in front (camera;time_ns;x0;...) on stdin, which "
            "the server triangulates as they come")
      ->required();
  AddOption(app, "--output", "FILE", &options->output,
            "File to write: time, label, x_m, y_m, z_m, sigmas, covariances; Apache Parquet if it "
            "ends in .parquet; for programs of motion capture frames in mm: TRC if it ends in "
            ".trc, C3D if in .c3d; else CSV; - for CSV on stdout")
      ->required();
  AddForceOption(app, &options->force);
  AddOption(app, "--sigma-px", "PX", &options->triangulation.sigma_px,
            "One sigma of each coordinate of a centre, pixels; without it as the calibration's "
            "residuals scatter, camera by camera")
      ->check(NumberBetween(1e-3, 100));
  AddOption(app, "--max-sigmas", "N", &options->triangulation.max_sigmas,
            "A centre further than this from the point of all its views is left out (default 5)")
      ->check(NumberBetween(1, 1e6));
  app->add_option_function<double>(
         "--diameter", [options = options](double diameter_m) { options->diameter_m = diameter_m; },
         "Diameter of the spheres whose image centres the rows hold, metres; 0: the rows hold the "
         "spheres' own centres; without it as in the calibration's target")
      ->type_name("M")
      ->check(NumberBetween(0, 10));
}

}  // namespace rigcal::client
