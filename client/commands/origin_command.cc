// SPDX-License-Identifier: Apache-2.0
#include "client/commands/origin_command.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "client/commands/command_parser.h"
#include "client/commands/fetch_calibration.h"
#include "client/output/output.h"
#include "client/results/calibration_file.h"
#include "client/results/marker_rows.h"
#include "client/results/origin_report.h"
#include "common/origin/still_points.h"
#include "common/status/status_macros.h"
#include "common/target/target_file.h"

namespace rigcal::client {
namespace {

constexpr size_t kMaxPathPoints = 150;

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

absl::StatusOr<std::vector<CameraRows>> RowsOfFolder(const CalibrationResult& calibration,
                                                     const std::string& folder,
                                                     CommandContext& context) {
  std::vector<std::string> names;
  for (const CalibratedCamera& camera : calibration.cameras) names.push_back(camera.camera);
  RIGCAL_ASSIGN_OR_RETURN(MarkerRows rows, ReadMarkerRows(folder, names));
  for (const std::string& warning : rows.warnings) context.console.Message(warning);
  return std::move(rows.cameras);
}

TriangulationOptions TriangulationOf(const CalibrationResult& calibration,
                                     const OriginCommandOptions& options) {
  TriangulationOptions triangulation;
  triangulation.sigma_px = options.sigma_px;
  triangulation.diameter_m = calibration.target.given.diameter_m;
  return triangulation;
}

absl::StatusOr<std::vector<StillPoint>> StillPointsOf(const CalibrationResult& calibration,
                                                      const std::string& folder,
                                                      const OriginCommandOptions& options,
                                                      CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<CameraRows> rows,
                          RowsOfFolder(calibration, folder, context));
  StillOptions still;
  still.min_still_s = options.still_s;
  still.triangulation = TriangulationOf(calibration, options);
  return FindStillPoints(calibration, rows, still);
}

absl::StatusOr<OriginSolution> OriginOfFloor(const CalibrationResult& calibration,
                                             const OriginCommandOptions& options,
                                             CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<StillPoint> still,
                          StillPointsOf(calibration, options.floor, options, context));
  std::vector<OriginPoint> points;
  size_t second = 0;
  for (const StillPoint& point : still) {
    if (point.place == still.front().place) second = points.size();
    points.push_back({absl::StrCat("marker ", point.marker, " at place ", point.place + 1),
                      point.position_m, point.noise_m2, point.gain, 0});
  }
  return FloorOrigin(calibration, points, 0, second, options.height_m, options.origin);
}

// Evenly chosen points of a path.
absl::StatusOr<OriginSolution> OriginOfPath(const CalibrationResult& calibration,
                                            const OriginCommandOptions& options,
                                            CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(std::vector<CameraRows> rows,
                          RowsOfFolder(calibration, options.path, context));
  RIGCAL_ASSIGN_OR_RETURN(
      const Triangulation path,
      TriangulateRows(calibration, std::move(rows), TriangulationOf(calibration, options)));
  const CameraCovariance covariance = UnpackCameraCovariance(calibration);
  std::vector<OriginPoint> points;
  size_t farthest = 0;
  const size_t stride = path.points.size() / kMaxPathPoints + 1;
  for (size_t i = 0; i < path.points.size(); i += stride) {
    const TriangulatedPoint& point = path.points[i];
    OriginPoint& added = points.emplace_back();
    added.name = absl::StrCat("marker ", point.marker, " at ",
                              1e-9 * static_cast<double>(point.rig_time_ns), " s");
    added.position_m = point.position_m;
    added.noise_m2 = point.noise_m2;
    const auto fitted = FitPoint(calibration.cameras, point.views);
    if (fitted && covariance.matrix.size() > 0) {
      added.gain = PointGain(calibration.cameras, covariance, point.views, *fitted);
    }
    const auto away = [&](size_t j) {
      return (points[j].position_m - points[0].position_m).norm();
    };
    if (away(points.size() - 1) > away(farthest)) farthest = points.size() - 1;
  }
  return FloorOrigin(calibration, points, 0, farthest, options.height_m, options.origin);
}

absl::StatusOr<OriginSolution> OriginOfPoints(const CalibrationResult& calibration,
                                              const OriginCommandOptions& options,
                                              CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<GivenPoint> given,
                          ReadTargetFile(options.points, PointLines::kWithPosition));
  std::vector<OriginPoint> points;
  std::vector<Eigen::Vector3d> known_m;
  std::vector<std::string> unseen;
  const auto add = [&](const TargetPoint& point, OriginPoint measured) {
    measured.name = point.label;
    measured.sigma_m = point.sigma_m;
    points.push_back(std::move(measured));
    known_m.emplace_back(point.x_m, point.y_m, point.z_m);
  };
  std::vector<StillPoint> still;
  if (!options.data.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(still, StillPointsOf(calibration, options.data, options, context));
  }
  for (size_t i = 0; i < given.size(); ++i) {
    const TargetPoint& point = given[i].point;
    const size_t before = points.size();
    for (const StillPoint& seen : still) {
      if (seen.marker != static_cast<int>(i) || seen.place != 0) continue;
      add(point, {"", seen.position_m, seen.noise_m2, seen.gain, 0});
    }
    for (const CalibratedPoint& seen : calibration.target.static_points) {
      if (!options.data.empty() || seen.label != point.label) continue;
      add(point, {"", seen.position_m, Eigen::Matrix3d::Zero(), Eigen::Matrix3Xd(3, 0), 0});
    }
    if (points.size() == before) unseen.push_back(point.label);
  }
  if (!unseen.empty()) {
    context.console.Message(
        absl::StrCat("not seen by the rig, and left out: ", absl::StrJoin(unseen, ", ")));
  }
  return PointOrigin(calibration, points, known_m, options.origin);
}

absl::StatusOr<OriginSolution> SolveOrigin(const CalibrationResult& calibration,
                                           const OriginCommandOptions& options,
                                           CommandContext& context) {
  if (!options.floor.empty()) return OriginOfFloor(calibration, options, context);
  if (!options.path.empty()) return OriginOfPath(calibration, options, context);
  if (!options.points.empty()) return OriginOfPoints(calibration, options, context);
  if (!options.down.empty()) {
    RIGCAL_ASSIGN_OR_RETURN(const std::vector<double> down,
                            NumbersOf(options.down, 3, "three numbers X,Y,Z"));
    return LevelOrigin(calibration, Eigen::Vector3d(down[0], down[1], down[2]));
  }
  RIGCAL_ASSIGN_OR_RETURN(
      const std::vector<double> given,
      NumbersOf(options.transform, 7, "seven numbers X,Y,Z,QW,QX,QY,QZ (metres, quaternion)"));
  const Eigen::Quaterniond rotation(given[3], given[4], given[5], given[6]);
  if (std::abs(rotation.norm() - 1) > 1e-3) {
    return absl::InvalidArgumentError(
        absl::StrCat("the quaternion of --transform has the length ", rotation.norm(), ", not 1"));
  }
  return GivenOrigin(calibration,
                     {rotation.normalized(), Eigen::Vector3d(given[0], given[1], given[2])});
}

absl::StatusOr<OriginReport> MakeOrigin(const OriginCommandOptions& options,
                                        CommandContext& context) {
  RIGCAL_ASSIGN_OR_RETURN(CalibrationFile file, FetchCalibrationFile(options.calibration, context));
  RIGCAL_ASSIGN_OR_RETURN(const CalibrationResult calibration, ResultOf(file));
  OriginReport report;
  RIGCAL_ASSIGN_OR_RETURN(report.solution, SolveOrigin(calibration, options, context));
  SetResult(ChangeFrame(calibration, report.solution.change), &file);
  RIGCAL_RETURN_IF_ERROR(ReplaceFile(options.output, CalibrationText(file)));
  report.calibration = options.calibration;
  report.output = options.output;
  return report;
}

}  // namespace

ExitCode SetOrigin(const OriginCommandOptions& options, CommandContext& context) {
  return context.Show(MakeOrigin(options, context), FormatOrigin);
}

void AddOriginCommand(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "origin",
      "The same calibration with another origin and axes, such as the floor as z = 0", SetOrigin);
  AddArgument(app, "CALIBRATION",
              "Id of a calibration, or the path (with a . or /) of an exported calibration.json",
              &options->calibration);
  AddOption(app, "--output", "FILE", &options->output, "calibration.json to write")->required();
  app->option_defaults()->group("One of these");
  AddOption(
      app, "--floor", "DIR", &options->floor,
      "Folder of rows in which the wand lies on the floor at two or three places: z = 0 is "
      "the floor, z up, the origin below marker 0 at the first place, x along the wand there");
  AddOption(app, "--points", "FILE", &options->points,
            "Named points with their coordinates in the new frame, a line with label, x, y, z and "
            "sigma (m) for each; seen in --data in the order of the lines, or among the static "
            "points of the calibration");
  AddOption(app, "--path", "DIR", &options->path,
            "Folder of rows of a path in one plane, which becomes z = 0");
  AddOption(app, "--down", "X,Y,Z", &options->down,
            "Direction of gravity in the rig frame: z is turned against it, the origin stays");
  AddOption(app, "--transform", "X,Y,Z,QW,QX,QY,QZ", &options->transform,
            "new_from_rig: metres and a unit quaternion");
  app->option_defaults()->group("Options");
  AddOption(app, "--data", "DIR", &options->data, "Folder of rows in which --points are seen");
  AddOption(app, "--height", "M", &options->height_m,
            "Height of the markers' centres above the floor, metres: their radius (default 0)")
      ->check(NumberBetween(-100, 100));
  AddOption(app, "--still", "S", &options->still_s,
            "A place is where every marker rests for so long, seconds (default 0.5)")
      ->check(NumberBetween(0.05, 3600));
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each coordinate of a centre, pixels; without it as the calibration's "
            "residuals scatter")
      ->check(NumberBetween(1e-3, 100));
  app->add_option_function<double>(
         "--max-residual-mm",
         [options = options](double mm) { options->origin.max_residual_m = mm / 1000; },
         "Largest accepted residual, root mean square, mm (default 5)")
      ->type_name("MM")
      ->check(NumberBetween(1e-3, 1e6));
  AddOption(app, "--max-sigma-deg", "DEG", &options->origin.max_rotation_sigma_deg,
            "Largest accepted one sigma of the axes, degrees (default 0.25)")
      ->check(NumberBetween(1e-6, 180));
  app->add_flag_callback(
      "--below", [options = options] { options->origin.cameras_above = false; },
      "With --points: cameras may be below the points' plane");
  app->parse_complete_callback([app = app] {
    size_t given = 0;
    for (const char* name : {"--floor", "--points", "--path", "--down", "--transform"}) {
      given += app->count(name);
    }
    if (given != 1) {
      throw CLI::ValidationError("rigcal calibration origin",
                                 "needs one of --floor, --points, --path, --down, --transform");
    }
  });
}

}  // namespace rigcal::client
