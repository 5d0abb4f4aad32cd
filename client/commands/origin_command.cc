// SPDX-License-Identifier: Apache-2.0
#include "client/commands/origin_command.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/fetch_calibration.h"
#include "client/output/output.h"
#include "client/results/calibration_file.h"
#include "client/results/calibration_import.h"
#include "client/results/origin_report.h"
#include "common/board/board.h"
#include "common/file/durable_file.h"
#include "common/file/may_write.h"
#include "common/origin/solve_origin.h"
#include "common/status/status_macros.h"
#include "common/target/target.h"
#include "common/target/target_file.h"
#include "common/triangulate/camera_agreement.h"

namespace rigcal::client {
namespace {

constexpr double kRadPerDeg = 0.017453292519943295;

absl::StatusOr<std::vector<double>> NumbersOf(const std::string& text, size_t count,
                                              const char* what) {
  std::vector<double> values;
  for (const std::string& part : std::vector<std::string>(absl::StrSplit(text, ','))) {
    double value = 0;
    if (!absl::SimpleAtod(part, &value) || !std::isfinite(value)) break;
    values.push_back(value);
  }
  if (values.size() == count) return values;
  return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not ", what));
}

// The points of a printed board that lies with its print up: origin at point 0, x along a row, z
// out of the print, metres.
absl::StatusOr<std::vector<TargetPoint>> BoardPoints(const std::string& text) {
  RIGCAL_ASSIGN_OR_RETURN(const Board board, ParseBoard(text));
  RIGCAL_ASSIGN_OR_RETURN(const Target target, MakeBoardTarget(board));
  std::vector<TargetPoint> points = target.points;
  // In frame `board` z points away from who looks at the print, except of an April grid.
  if (board.kind != BoardKind::kAprilGrid) {
    for (TargetPoint& point : points) point.y_m = -point.y_m, point.z_m = -point.z_m;
  }
  return points;
}

// What the options mean, without rows.
absl::StatusOr<OriginRequest> RequestOf(const OriginCommandOptions& options) {
  OriginRequest request = options.request;
  if (!options.floor.empty() || options.floor_session) {
    request.source = FrameSource::kFloor;
  } else if (!options.path.empty() || options.path_session) {
    request.source = FrameSource::kPath;
  } else if (!options.points.empty()) {
    request.source = FrameSource::kPoints;
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<GivenPoint> given,
                            ReadTargetFile(options.points, PointLines::kWithPosition));
    for (const GivenPoint& point : given) request.points.push_back(point.point);
  } else if (!options.board.empty()) {
    request.source = FrameSource::kPoints;
    RIGCAL_ASSIGN_OR_RETURN(request.points, BoardPoints(options.board));
  } else if (!options.down.empty()) {
    request.source = FrameSource::kDown;
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> down,
                            NumbersOf(options.down, 3, "three numbers X,Y,Z"));
    std::ranges::copy(down, request.down.begin());
  } else {
    request.source = FrameSource::kTransform;
    RIGCAL_ASSIGN_OR_RETURN(
        const std::vector<double> given,
        NumbersOf(options.transform, 7, "seven numbers X,Y,Z,QW,QX,QY,QZ (metres, quaternion)"));
    std::copy_n(given.begin(), 3, request.translation_m.begin());
    std::copy_n(given.begin() + 3, 4, request.rotation_wxyz.begin());
  }
  RIGCAL_RETURN_IF_ERROR(request.Validate());
  return request;
}

std::string FolderOf(const OriginCommandOptions& options) {
  return absl::StrCat(options.floor, options.path, options.data);
}

absl::StatusOr<std::vector<MarkerViews>> MeasureFolder(const CalibrationResult& calibration,
                                                       const OriginRequest& request,
                                                       const OriginCommandOptions& options,
                                                       CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<CameraRows> rows,
                          FolderRows(calibration, FolderOf(options), context));
  TriangulationOptions triangulation;
  triangulation.sigma_px = options.sigma_px;
  triangulation.diameter_m = calibration.target.given.diameter_m;
  std::map<std::string, uint32_t> left_out_rows;
  RIGCAL_ASSIGN_OR_RETURN(
      std::vector<MarkerViews> measured,
      MeasureForOrigin(calibration, request, rows, triangulation, &left_out_rows));
  if (!left_out_rows.empty()) {
    context.console.Message(
        absl::StrCat("left out, because they miss the rays of the other cameras: ",
                     DescribeLeftOut(rows, left_out_rows)));
  }
  return measured;
}

absl::StatusOr<OriginReport> WriteOrigin(const std::string& which,
                                         const OriginCommandOptions& options, OriginRequest request,
                                         CommandContext& context) {
  RIGCAL_RETURN_IF_ERROR(CheckOutputFile(options.target.output, options.target.force));
  RIGCAL_ASSIGN_OR_RETURN(CalibrationFile file, FetchCalibrationFile(which, context));
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
  std::vector<MarkerViews> measured;
  if (!FolderOf(options).empty()) {
    RIGCAL_ASSIGN_OR_RETURN(measured, MeasureFolder(calibration, request, options, context));
  }
  std::vector<std::string> unseen;
  OriginReport report;
  const absl::StatusOr<OriginSolution> solution =
      SolveOrigin(calibration, request, measured, {}, &unseen);
  if (!unseen.empty()) {
    context.console.Message(
        absl::StrCat("not seen by the rig, and left out: ", absl::StrJoin(unseen, ", ")));
  }
  RIGCAL_RETURN_IF_ERROR(solution.status());
  report.solution = *solution;
  SetResult(WithOrigin(calibration, file.calibration.id(), request.source, *solution), &file);
  RIGCAL_RETURN_IF_ERROR(WriteOutputFile(options.target.output, CalibrationText(file)));
  report.calibration = which;
  report.output = options.target.output;
  return report;
}

// The server makes it, of the rows of a session or of what is seen in a folder.
absl::StatusOr<v1::CreateCalibrationRequest> ServerRequest(const std::string& which,
                                                           const OriginCommandOptions& options,
                                                           OriginRequest request,
                                                           CommandContext& context) {
  if (!FolderOf(options).empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const CalibrationFile file, FetchCalibrationFile(which, context));
    RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
    RIGCAL_ASSIGN_OR_RETURN(request.measured,
                            MeasureFolder(calibration, request, options, context));
  }
  CalibrationOptions calibration_options;
  calibration_options.kind = SolveKind::kOrigin;
  calibration_options.parent_id = which;
  calibration_options.sigma_px = options.sigma_px;
  calibration_options.origin = std::move(request);
  return MakeCalibrationRequest({}, calibration_options);
}

}  // namespace

ExitCode SetOrigin(const OriginCommandOptions& options, CommandContext& context) {
  const absl::StatusOr<std::string> which = WhichCalibration(options.target, context);
  if (!which.ok()) return context.Fail(which.status());
  absl::StatusOr<OriginRequest> request = RequestOf(options);
  if (!request.ok()) return context.Fail(request.status());
  if (!options.target.output.empty()) {
    return context.Show(WriteOrigin(*which, options, *std::move(request), context), FormatOrigin);
  }
  absl::StatusOr<v1::CreateCalibrationRequest> create =
      ServerRequest(*which, options, *std::move(request), context);
  if (!create.ok()) return context.Fail(create.status());
  return DeriveOnServer(options.target, *which, *std::move(create), context);
}

void AddOriginCommand(CommandParser& parser, CLI::App* group, bool rig) {
  auto [app, options] = parser.AddCommand(
      group, "origin",
      rig ? "The active calibration of a rig with another origin and axes, such as the floor as "
            "z = 0"
          : "The same calibration with another origin and axes, such as the floor as z = 0",
      SetOrigin);
  AddFrameTarget(app, rig, &options->target);
  app->option_defaults()->group("One of these");
  AddOption(
      app, "--floor", "DIR", &options->floor,
      "Folder of rows in which the wand lies on the floor at two or three places: z = 0 is "
      "the floor, z up, the origin below marker 0 at the first place, x along the wand there");
  app->add_flag("--on-floor", options->floor_session, "The same of the rows of --session");
  AddOption(app, "--points", "FILE", &options->points,
            "Named points with their coordinates in the new frame, a line with label, x, y, z and "
            "sigma (m) for each; seen in --data or --session in the order of the lines or by the "
            "labels of the session's target, or among the static points of the calibration");
  AddOption(
      app, "--board", "BOARD", &options->board,
      "A printed board (board:checker,9x6,0.04) that lies or hangs in the room and is seen in "
      "--data or --session: z = 0 is the print, z out of it, the origin at its first point, x "
      "along a row");
  AddOption(app, "--path", "DIR", &options->path,
            "Folder of rows of a path in one plane, which becomes z = 0");
  app->add_flag("--on-plane", options->path_session, "The same of the rows of --session");
  AddOption(app, "--down", "X,Y,Z", &options->down,
            "Direction of gravity in the rig frame: z is turned against it, the origin stays");
  AddOption(app, "--transform", "X,Y,Z,QW,QX,QY,QZ", &options->transform,
            "new_from_rig: metres and a unit quaternion");
  app->option_defaults()->group("Options");
  AddOption(app, "--data", "DIR", &options->data,
            "Folder of rows in which --points or --board are seen")
      ->excludes("--session");
  AddOption(app, "--height", "M", &options->request.height_m,
            "Height of the markers' centres above the floor, metres: their radius (default 0)")
      ->check(NumberBetween(-100, 100));
  AddOption(app, "--still", "S", &options->request.still_s,
            "A place is where every marker rests for so long, seconds (default 0.5)")
      ->check(NumberBetween(0.05, 3600));
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each coordinate of a centre, pixels; without it as the calibration's "
            "residuals scatter")
      ->check(NumberBetween(1e-3, 100));
  app->add_option_function<double>(
         "--max-residual-mm",
         [options = options](double mm) { options->request.max_residual_m = mm / 1000; },
         "Largest accepted residual, root mean square, mm (default 5)")
      ->type_name("MM")
      ->check(NumberBetween(1e-3, 1e6));
  app->add_option_function<double>(
         "--max-sigma-deg",
         [options = options](double deg) {
           options->request.max_rotation_sigma_rad = kRadPerDeg * deg;
         },
         "Largest accepted one sigma of the axes, degrees (default 0.25)")
      ->type_name("DEG")
      ->check(NumberBetween(1e-6, 180));
  app->add_flag("--below", options->request.cameras_below,
                "With --points: cameras may be below the points' plane");
  app->parse_complete_callback([app = app, options = options] {
    size_t given = 0;
    for (const char* name : {"--floor", "--on-floor", "--points", "--board", "--path", "--on-plane",
                             "--down", "--transform"}) {
      given += app->count(name);
    }
    if (given != 1) {
      throw CLI::ValidationError(
          app->get_display_name(),
          "needs one of --floor, --on-floor, --points, --board, --path, --on-plane, --down, "
          "--transform");
    }
    if (app->count("--data") > 0 && app->count("--points") + app->count("--board") == 0) {
      throw CLI::ValidationError("--data", "is for --points and --board");
    }
    const bool of_session = options->floor_session || options->path_session;
    if (of_session && options->target.session.empty()) {
      throw CLI::ValidationError("--on-floor and --on-plane", "need --session");
    }
    if (!options->target.session.empty() && !of_session && options->points.empty() &&
        options->board.empty()) {
      throw CLI::ValidationError("--session",
                                 "goes with --on-floor, --on-plane, --points or --board");
    }
    if (!options->board.empty() && options->target.session.empty() && options->data.empty()) {
      throw CLI::ValidationError("--board", "needs --session or --data, in which it is seen");
    }
  });
}

}  // namespace rigcal::client
