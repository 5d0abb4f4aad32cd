// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "client/commands/calibrate_command.h"
#include "client/commands/calibration_accuracy_command.h"
#include "client/commands/calibration_command.h"
#include "client/commands/command_parser.h"

namespace rigcal::client {
namespace {

struct IdCommand {
  const char* name;
  const char* description;
  ExitCode (*run)(const std::string&, CommandContext&);
};
constexpr IdCommand kIdCommands[] = {
    {"get", "One calibration with everything in it", GetCalibration},
    {"cancel", "Stop one that is queued or running", CancelCalibration},
    {"delete", "Remove one that has ended", DeleteCalibration},
};

void AddCalibrate(CommandParser& parser) {
  const auto options = std::make_shared<CalibrateOptions>();
  CLI::App* app = parser.AddCommand(
      nullptr, "calibrate", "Calibrate from one or more finished sessions",
      [options](CommandContext& context) { return Calibrate(*options, context); });
  app->add_option("SESSION", options->sessions, "Ids of the sessions")->type_name("")->required();
  app->add_flag("--wait", options->wait, "Return with the result");
  AddCalibrationOptions(app, &options->calibration);
}

void AddExport(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<CalibrationExportOptions>();
  CLI::App* app = parser.AddCommand(
      group, "export", "Write a calibration as files for other programs",
      [options](CommandContext& context) { return ExportCalibration(*options, context); });
  app->add_option("ID", options->id, "Id of the calibration")->type_name("")->required();
  app->add_option_function<std::string>(
         "--format",
         [options](const std::string& format) {
           options->format = format == "json" ? ExportFormat::kJson : ExportFormat::kOpenCv;
         },
         "opencv: one FileStorage YAML per camera (camera_matrix, distortion_coefficients, "
         "extrinsics: cam_from_rig 4x4 in metres, reprojection_error); json: the whole calibration")
      ->type_name("opencv|json")
      ->check(CLI::IsMember({"opencv", "json"}).description(""))
      ->required();
  app->add_option("--output", options->output,
                  "Folder to write into, made where missing; - with json: stdout")
      ->type_name("DIR")
      ->required();
  app->parse_complete_callback([options] {
    if (options->output == "-" && options->format == ExportFormat::kOpenCv) {
      throw CLI::ValidationError("--output -", "goes with --format json only");
    }
    if (options->output.empty()) throw CLI::ValidationError("--output", "is empty");
  });
}

void AddCompare(CommandParser& parser, CLI::App* group) {
  const auto ids = std::make_shared<std::pair<std::string, std::string>>();
  CLI::App* app = parser.AddCommand(
      group, "compare", "How far B's cameras are from A's after the best rigid alignment",
      [ids](CommandContext& context) {
        return CompareCalibrations(ids->first, ids->second, context);
      });
  app->add_option("A", ids->first, "Id of a calibration")->type_name("")->required();
  app->add_option("B", ids->second, "Id of another")->type_name("")->required();
}

void AddAccuracy(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<AccuracyCommandOptions>();
  CLI::App* app = parser.AddCommand(
      group, "accuracy", "How well points can be triangulated with a calibration",
      [options](CommandContext& context) { return ShowAccuracy(*options, context); });
  app->add_option("ID", options->id, "Id of the calibration")->type_name("")->required();
  app->add_option("--point", options->points,
                  "At this point of the rig frame, metres; may be repeated. Without points and "
                  "--grid: on a grid where the wand was")
      ->type_name("X,Y,Z")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->check([](const std::string& text) {
        const absl::StatusOr<v1::Vector3> point = ParsePoint(text);
        return point.ok() ? std::string() : std::string(point.status().message());
      });
  app->add_option("--grid", options->grid_step_m,
                  "On a grid of this spacing where the wand was, metres")
      ->type_name("STEP_M")
      ->check(CLI::PositiveNumber.description(""));
  app->add_option("--sigma-px", options->sigma_px,
                  "One sigma of each coordinate of a marker's centre, pixels (default 0.3)")
      ->type_name("PX")
      ->check(CLI::PositiveNumber.description(""));
}

}  // namespace

void AddCalibrationCommands(CommandParser& parser) {
  AddCalibrate(parser);
  CLI::App* group =
      parser.AddGroup("calibration", "Calibrations: the results (list, get, export, compare, ...)");
  const auto list = std::make_shared<ListOptions>();
  CLI::App* list_app = parser.AddCommand(
      group, "list", "Calibrations, newest first",
      [list](CommandContext& context) { return ListCalibrations(*list, context); });
  list_app->add_option("--session", list->session, "Made from this session only")
      ->type_name("SESSION");
  AddListOptions(list_app, "state=STATE_SUCCEEDED", "create_time or id", list.get());
  for (const IdCommand& command : kIdCommands) {
    const auto id = std::make_shared<std::string>();
    parser
        .AddCommand(group, command.name, command.description,
                    [id, run = command.run](CommandContext& context) { return run(*id, context); })
        ->add_option("ID", *id, "Id of the calibration")
        ->type_name("")
        ->required();
  }
  AddExport(parser, group);
  AddCompare(parser, group);
  AddAccuracy(parser, group);
}

}  // namespace rigcal::client
