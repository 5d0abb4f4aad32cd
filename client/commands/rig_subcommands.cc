// SPDX-License-Identifier: Apache-2.0
#include "client/commands/command_parser.h"
#include "client/commands/monitor_command.h"
#include "client/commands/origin_command.h"
#include "client/commands/rig_command.h"
#include "client/commands/scale_command.h"

namespace rigcal::client {
namespace {

void AddReason(CLI::App* app, ActivateOptions* options) {
  AddOption(app, "--reason", "TEXT", &options->reason, "Why; it is kept in the history");
  app->add_flag("--force", options->force,
                "Also a calibration that is graded bad or has other cameras");
}

void AddMonitor(CommandParser& parser) {
  auto [app, options] = parser.AddCommand(
      nullptr, "monitor",
      "Say of each camera of a rig whether it is still where the active calibration has it, from "
      "a session of a few seconds of waving",
      Monitor);
  AddArgument(app, "RIG", "The rig", &options->rig);
  AddOption(app, "--session", "SESSION", &options->session,
            "A finished session of that rig; without it what the server's own monitor says "
            "(rigcal rig monitor)");
  AddOption(app, "--against", "ID", &options->against,
            "Calibration to compare with; without it the active one");
  app->add_flag("--auto", options->repair,
                "Solve the cameras that moved again, and make the result active if it is good");
}

}  // namespace

void AddRigCommands(CommandParser& parser) {
  CLI::App* group =
      parser.AddGroup("rig", "Rigs: which calibration is the active one (list, activate, ...)");
  parser.AddCommand(group, "list", "All rigs with their active calibrations", ListRigs);
  auto [get, get_name] = parser.AddCommand(group, "get", "One rig", GetRig);
  AddArgument(get, "RIG", "Name of the rig", get_name);
  auto [activate, options] = parser.AddCommand(
      group, "activate", "Make a calibration the active one of its rig", ActivateCalibration);
  AddArgument(activate, "ID", "Id of the calibration", &options->id);
  AddReason(activate, options);
  auto [history, history_name] = parser.AddCommand(
      group, "history", "Which calibrations were active, newest first", ShowHistory);
  AddArgument(history, "RIG", "Name of the rig", history_name);
  auto [rollback, rollback_options] = parser.AddCommand(
      group, "rollback", "Make the calibration active again that was so before", RollbackRig);
  AddArgument(rollback, "RIG", "Name of the rig", &rollback_options->id);
  AddReason(rollback, rollback_options);
  AddOriginCommand(parser, group, /*rig=*/true);
  AddScaleCommand(parser, group, /*rig=*/true);
  auto [monitor, mode] = parser.AddCommand(
      group, "monitor",
      "Whether the server compares every session of a rig with its active calibration",
      SetMonitorMode);
  AddArgument(monitor, "RIG", "Name of the rig", &mode->rig);
  monitor
      ->add_option("MODE", mode->mode,
                   "off; watch: say what has moved; repair: also solve it again after the session, "
                   "and make the result active if it is good; without it what it says now")
      ->check(CLI::IsMember({"off", "watch", "repair"}).description(""));
  AddMonitor(parser);
}

}  // namespace rigcal::client
