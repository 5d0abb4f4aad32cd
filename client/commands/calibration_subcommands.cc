// SPDX-License-Identifier: Apache-2.0
#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "client/commands/calibrate_command.h"
#include "client/commands/calibration_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/evaluate_command.h"
#include "client/commands/origin_command.h"
#include "client/commands/rig_command.h"
#include "client/commands/scale_command.h"
#include "client/results/calibration_export.h"
#include "client/results/import_units.h"

namespace rigcal::client {
namespace {

constexpr char kIdHelp[] = "Id of the calibration";
constexpr char kAllHelp[] =
    "Every camera; without it those of a rig of more than 16 that need something";

// "10", "10s" or "1.5min".
absl::StatusOr<double> ParseSeconds(const std::string& text) {
  absl::string_view number = text;
  double unit_s = 1;
  if (absl::ConsumeSuffix(&number, "min")) {
    unit_s = 60;
  } else {
    absl::ConsumeSuffix(&number, "s");
  }
  double value = 0;
  if (absl::SimpleAtod(number, &value) && value >= 0 && value * unit_s <= 1e6)
    return value * unit_s;
  return absl::InvalidArgumentError("is no time; wants seconds, like 10s, or 1.5min");
}

// "wand=0,0.13,0.39", or as --target.
absl::StatusOr<std::optional<Target>> ParseAssumed(const std::string& text) {
  std::string target = text;
  if (target.starts_with("wand=")) target[4] = ':';
  absl::StatusOr<Target> parsed = ParseTarget(target);
  if (!parsed.ok()) return parsed.status();
  return std::optional<Target>(*std::move(parsed));
}

CLI::Option* AddCameras(CLI::App* app, const char* name, std::vector<std::string>* cameras,
                        const std::string& what) {
  return AddOption(app, name, "CAMERA,...", cameras, what)->delimiter(',');
}

void AddKinds(CLI::App* app, CalibrateOptions* options) {
  const std::string other_group = app->option_defaults()->get_group();
  app->option_defaults()->group("What is kept of an earlier calibration");
  CLI::Option* only = AddCameras(
      app, "--only,--repair", &options->calibration.only_cameras,
      "Solve these cameras alone: the others keep the poses of the active calibration. A camera "
      "that it does not have joins the rig");
  app->add_flag("--refine", options->refine,
                "Solve all cameras, with the active calibration and its covariance as a prior")
      ->excludes(only);
  AddOption(app, "--parent", "ID", &options->calibration.parent_id,
            "With --only, --refine and --keep-frame: this calibration instead of the active one");
  AddCameras(app, "--fix-intrinsics", &options->calibration.fixed_intrinsics,
             "Keep the intrinsics of these cameras while those of others are refined");
  app->add_flag_callback(
      "--fix-offsets", [options] { options->calibration.time_offsets = Estimate::kFixed; },
      "Keep the time offsets as the clocks give them, as --time-offsets fixed");
  CLI::Option* const keep = app->add_flag_callback(
      "--keep-frame", [options] { options->calibration.frame = FrameChoice::kKeep; },
      "End in the frame of the active calibration (or of --parent), aligned over the cameras that "
      "did not move, or fail. Without it that is tried where the active calibration has an origin "
      "of its own");
  app->add_flag_callback(
         "--own-frame", [options] { options->calibration.frame = FrameChoice::kOwn; },
         "End in the frame of the reference camera, whatever the active calibration has")
      ->excludes(keep)
      ->excludes(only);
  keep->excludes(only);
  AddOption(app, "--prior", "FILE|ID", &options->prior,
            "Use the intrinsics of this calibration, or of another program's file (with a . or /), "
            "instead of those of the sessions");
  app->option_defaults()->group(other_group);
}

void AddWhatIf(CLI::App* app, CalibrationOptions* options) {
  const std::string other_group = app->option_defaults()->get_group();
  app->option_defaults()->group("What if (the result can never become active)");
  AddCameras(app, "--without", &options->without_cameras, "Leave these cameras out");
  AddOption(app, "--without-session", "SESSION", &options->without_sessions,
            "Leave this session out, which another one continues; may be repeated")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  AddParsedOption(app, "--from", "TIME", &options->from_s, ParseSeconds,
                  "Only from this long after each camera's first observation of a session: 10s");
  AddParsedOption(app, "--to", "TIME", &options->to_s, ParseSeconds, "And only up to this");
  AddParsedOption(app, "--assume", "wand=POSITIONS", &options->assumed_target, ParseAssumed,
                  "Take the wand for this one, as wand=0,0.1301,0.39");
  app->add_flag("--what-if", options->what_if, "A what-if without any of these");
  app->option_defaults()->group(other_group);
}

void AddCalibrate(CommandParser& parser) {
  auto [app, options] = parser.AddCommand(
      nullptr, "calibrate", "Calibrate from one or more finished sessions", Calibrate);
  AddArgument(app, "SESSION", "Ids of the sessions", &options->sessions);
  app->add_flag("--wait", options->wait, "Return with the result");
  app->add_flag("--activate", options->activate,
                "Wait, and make the result the active calibration of the rig if it is good");
  AddOption(app, "--reason", "TEXT", &options->reason, "Why; it is kept with the calibration");
  AddOption(app, "--notes", "TEXT", &options->notes, "Free text, likewise");
  AddCalibrationOptions(app, &options->calibration);
  AddKinds(app, options);
  AddWhatIf(app, &options->calibration);
}

constexpr char kUndistortedHelp[] =
    "For images whose lens distortion was taken out with the camera matrix kept: every camera is a "
    "pinhole";

void AddExportOptions(CLI::App* app, ExportOptions* options) {
  AddOption(app, "--max-error-px", "PX", &options->max_error_px,
            "Where the format cannot say a lens, the nearest one that it can say is written if it "
            "shows no point of the image wrong by more than this (default 0.5)")
      ->check(NumberBetween(0, 100));
  AddParsedOption(
      app, "--up", "y|z", &options->up, ParseUpAxis,
      "The axis of the rig frame that points up (z after rigcal calibration origin), for blender, "
      "whose z is up, and usd, which says its axis; without it the axes stay as they are");
}

void AddExport(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "export", "Write a calibration as files for other programs", ExportCalibration);
  AddArgument(app, "ID", kIdHelp, &options->id);
  std::vector<std::string> names, helps;
  for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
    names.emplace_back(format.name);
    helps.push_back(absl::StrCat(format.name, ": ", format.help));
  }
  AddOption(app, "--format", absl::StrJoin(names, "|"), &options->format,
            absl::StrJoin(helps, "; "))
      ->check(CLI::IsMember(names).description(""))
      ->required();
  AddOption(app, "--output", "DIR", &options->output,
            "Folder to write into, made where missing; - with json: stdout")
      ->required();
  AddForceOption(app, &options->force);
  app->add_flag("--undistorted", options->undistorted, kUndistortedHelp);
  AddExportOptions(app, &options->options);
  app->parse_complete_callback([options = options] {
    if (options->output == "-" && options->format != "json") {
      throw CLI::ValidationError("--output -", "goes with --format json only");
    }
    if (options->output.empty()) throw CLI::ValidationError("--output", "is empty");
  });
}

void AddImport(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "import", "Read another program's calibration and write it in a format of ours",
      ConvertCalibration);
  AddArgument(app, "FILE",
              "OpenCV or ROS (a file, or a folder of .yaml, .xml or .json files), kalibr, mrcal, "
              "caliscope, "
              "anipose or Pose2Sim, QTM (.qca.txt), Vicon (.xcp), COLMAP (a folder), nerfstudio, "
              "OpenMVG, or an exported calibration.json",
              &options->path);
  std::vector<std::string> names;
  for (const CalibrationExportFormat& format : CalibrationExportFormats()) {
    names.emplace_back(format.name);
  }
  options->format = "opencv";
  AddOption(app, "--format", absl::StrJoin(names, "|"), &options->format,
            "Format to write (default opencv, which agents read as calibration=FILE)")
      ->check(CLI::IsMember(names).description(""));
  AddOption(app, "--output", "DIR", &options->output, "Folder to write into, made where missing")
      ->required();
  AddForceOption(app, &options->force);
  AddOption(app, "--units", absl::StrJoin(LengthUnitNames(), "|"), &options->units,
            "Unit of the lengths in the file; without it as its format has them, metres for most")
      ->check(CLI::IsMember(LengthUnitNames()).description(""));
  app->add_flag("--undistorted", options->undistorted, kUndistortedHelp);
  AddExportOptions(app, &options->options);
}

void AddCompare(CommandParser& parser, CLI::App* group) {
  auto [app, ids] = parser.AddCommand(
      group, "compare", "How far B's cameras are from A's after the best rigid alignment",
      CompareCalibrations);
  AddArgument(app, "A",
              "Id of a calibration, or the path of another program's file (with a . or /)",
              &ids->a);
  AddArgument(app, "B", "Another", &ids->b);
}

void AddDiff(CommandParser& parser, CLI::App* group) {
  auto [app, ids] = parser.AddCommand(
      group, "diff",
      "Which cameras moved from A to B, by how much, and whether that is more than both "
      "uncertainties; the frames are aligned over the cameras that did not move",
      DiffCalibrations);
  AddArgument(app, "A", "Id of a calibration", &ids->a);
  AddArgument(app, "B", "Id of another", &ids->b);
}

void AddAccuracy(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "accuracy", "How well points can be triangulated with a calibration", ShowAccuracy);
  AddArgument(app, "ID", kIdHelp, &options->id);
  AddOption(app, "--point", "X,Y,Z", &options->points,
            "At this point of the rig frame, metres; may be repeated. Without points and "
            "--grid: on a grid where the wand was")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->check([](const std::string& text) {
        const absl::StatusOr<v1::Vector3> point = ParsePoint(text);
        return point.ok() ? std::string() : std::string(point.status().message());
      });
  AddOption(app, "--grid", "STEP_M", &options->grid_step_m,
            "On a grid of this spacing where the wand was, metres")
      ->check(CLI::PositiveNumber.description(""));
  AddOption(app, "--sigma-px", "PX", &options->sigma_px,
            "One sigma of each coordinate of a marker's centre, pixels (default 0.3)")
      ->check(CLI::PositiveNumber.description(""));
}

void AddResiduals(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "residuals",
      "How far projected markers are from measured ones, camera by camera; as JSON with vectors "
      "over the image",
      ShowResiduals);
  AddArgument(app, "ID", kIdHelp, &options->id);
  AddOption(app, "--camera", "NAME", &options->camera, "This camera only");
}

void AddEvaluate(CommandParser& parser) {
  auto [app, options] = parser.AddCommand(
      nullptr, "evaluate", "Error of triangulated points against ground truth", Evaluate, false);
  AddArgument(app, "FILE",
              "Triangulated positions: CSV with the columns time_s, x_m, y_m, z_m and, of several "
              "points, label",
              &options->estimate);
  AddOption(app, "--ground-truth", "FILE", &options->ground_truth,
            "Measured positions, with the same columns, in a frame and time of their own")
      ->required();
  app->add_flag("--scale", options->evaluation.fit_scale,
                "Fit the scale, too: a similarity instead of a rigid motion");
  app->add_flag("--keep-time", options->keep_time, "Fit no time offset");
  AddOption(
      app, "--longest-offset", "S", &options->evaluation.longest_offset_s,
      "Time offsets up to this are searched, seconds (default: all at which the two overlap)");
  AddOption(app, "--longest-gap", "S", &options->evaluation.longest_gap_s,
            "Gaps up to this are interpolated, seconds (default 0.1)");
  AddOption(app, "--plot", "FILE", &options->plot, "Write the errors over time as SVG");
  AddForceOption(app, &options->force);
}

}  // namespace

void AddCalibrationCommands(CommandParser& parser) {
  AddCalibrate(parser);
  AddEvaluate(parser);
  CLI::App* group =
      parser.AddGroup("calibration", "Calibrations: the results (list, get, export, compare, ...)");
  auto [list, options] =
      parser.AddCommand(group, "list", "Calibrations, newest first", ListCalibrations);
  list->add_option("--session", options->session, "Made from this session only")
      ->type_name("SESSION");
  AddListOptions(list, "state=STATE_SUCCEEDED", "create_time or id", options);
  const auto add = [&](const char* name, const char* description, auto run) {
    auto [app, id] = parser.AddCommand(group, name, description, run);
    AddArgument(app, "ID", kIdHelp, id);
  };
  auto [get, shown] =
      parser.AddCommand(group, "get", "One calibration with everything in it", GetCalibration);
  get->alias("show");
  AddArgument(get, "ID", kIdHelp, &shown->id);
  get->add_flag("--all", shown->all, kAllHelp);
  add("cancel", "Stop one that is queued or running", CancelCalibration);
  auto [remove, removed] =
      parser.AddCommand(group, "delete", "Remove one that has ended", DeleteCalibration);
  AddArgument(remove, "ID", kIdHelp, &removed->id);
  AddYesOption(remove, &removed->yes);
  AddExport(parser, group);
  AddImport(parser, group);
  AddCompare(parser, group);
  AddDiff(parser, group);
  AddAccuracy(parser, group);
  AddResiduals(parser, group);
  add("explain", "Which sessions, spans of time and cameras hold which parameter",
      ExplainCalibration);
  AddOriginCommand(parser, group, /*rig=*/false);
  AddScaleCommand(parser, group, /*rig=*/false);
}

}  // namespace rigcal::client
