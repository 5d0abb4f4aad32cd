// SPDX-License-Identifier: Apache-2.0
#include "client/commands/agent_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/identity_command.h"
#include "client/commands/session_command.h"
#include "common/command_line/command_line.h"

namespace rigcal::client {
namespace {

constexpr double kMaxDrainTimeoutS = 600;
constexpr double kLeastGoalMm = 0.001;
constexpr double kMostGoalMm = 1000;
constexpr double kMostMinSeconds = 86400;
constexpr char kSessionHelp[] = "Id of the session";

// A command whose only argument is a session.
void AddIdCommand(CommandParser& parser, CLI::App* group, const char* name, const char* description,
                  ExitCode (*run)(const std::string&, CommandContext&)) {
  auto [app, id] = parser.AddCommand(group, name, description, run);
  AddArgument(app, "SESSION", kSessionHelp, id);
}

void AddCreate(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "create", "Make a session, and with --start begin to capture", CreateSession);
  AddTargetOption(app, /*required=*/true, &options->target);
  AddOption(app, "--id", "ID", &options->id,
            "Id of the session: letters, digits, '_', '-'; without it the server makes one");
  AddOption(app, "--rig", "RIG", &options->rig, "Rig that is captured; without it \"rig\"");
  AddOption(app, "--title", "TEXT", &options->title, "Title to show in lists");
  AddOption(app, "--camera", "NAME", &options->cameras,
            "Cameras that take part; without it all that are connected at the start")
      ->delimiter(',');
  app->add_flag("--start", options->start, "Start it at once");
  CLI::Option* until =
      AddOption(app, "--until-mm", "MM", &options->until_mm,
                "End it when the expected error is below this in 95 % of the waved volume and a "
                "held-out check agrees")
          ->check(NumberBetween(kLeastGoalMm, kMostGoalMm));
  AddOption(app, "--min-seconds", "SECONDS", &options->min_s,
            "With --until-mm: capture at least this long; without it 20 s")
      ->check(NumberBetween(0, kMostMinSeconds))
      ->needs(until);
  AddOption(app, "--continue", "SESSION", &options->continues,
            "A finished session that this one continues: a calibration uses both");
}

void AddStop(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "stop", "End the capture; the server still takes what is on its way", StopSession);
  AddArgument(app, "SESSION", kSessionHelp, &options->id);
  AddOption(app, "--drain-timeout", "SECONDS", &options->drain_timeout_s,
            "How long the server waits for the agents; without it 10 s")
      ->check(NumberBetween(0, kMaxDrainTimeoutS));
  app->add_flag("--wait", options->wait, "Return when the session is finished");
}

void AddDiscard(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(group, "discard",
                                          "Throw a session away: nothing is deleted, but no "
                                          "calibration uses it and no session continues it",
                                          DiscardSession);
  AddArgument(app, "SESSION", kSessionHelp, &options->id);
  app->add_flag("--undo", options->undo, "Take it back");
}

void AddResume(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(group, "resume",
                                          "Continue a finished session: start a new one with the "
                                          "same target and cameras; a calibration "
                                          "uses both",
                                          ResumeSession);
  AddArgument(app, "SESSION", kSessionHelp, &options->id);
  AddOption(app, "--until-mm", "MM", &options->until_mm,
            "End it when the expected error is below this, as with create; without it: by hand")
      ->check(NumberBetween(kLeastGoalMm, kMostGoalMm));
}

void AddPrune(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "prune",
      "Delete the observations of old finished sessions, oldest first. What a calibration was made "
      "from is kept, and so are the sessions themselves with their counts",
      PruneSessions);
  AddOption(app, "--older-than", "DAYS", &options->older_than_days,
            "Finished at least so many days ago")
      ->check(NumberBetween(0.0001, 36500));
  AddOption(app, "--max-size", "MIB", &options->max_mib,
            "The oldest, until the database has at most so many MiB")
      ->check(NumberBetween(1, 1e9));
  AddOption(app, "--rig", "RIG", &options->rig, "Of this rig only");
  app->add_flag("--include-calibrated", options->include_calibrated,
                "Also what calibrations were made from: they stay, but cannot be solved again");
  app->add_flag("--dry-run", options->dry_run, "Say what would be deleted, and delete nothing");
}

void AddObservations(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "observations",
      "Write what is stored: with --output as the files that rigcal local --data and rigcal "
      "triangulate read; without it on stdout as one CSV, camera,stream_epoch,seq,clock_epoch,"
      "time_ns and x,y of each marker (empty: not visible), in the order (camera, stream_epoch, "
      "seq), as JSON one batch per line",
      WriteSessionObservations);
  AddArgument(app, "SESSION", kSessionHelp, &options->session);
  AddOption(app, "--output", "DIR", &options->output,
            "Folder for <camera>.csv (time_ns;x0;y0;x1;y1;..., -1: not seen) and <camera>.yaml "
            "(OpenCV intrinsics) of each camera, made where missing");
  AddForceOption(app, &options->force);
  AddOption(app, "--camera", "NAME", &options->camera, "This camera only");
  app->add_flag("--include-late", options->include_late,
                "Include observations that arrived after the session had finished");
}

void AddPreview(CommandParser& parser, CLI::App* group) {
  auto [app, options] = parser.AddCommand(
      group, "preview",
      "The current frame of a camera that captures, with the detection drawn into it, as a JPEG "
      "file. "
      "Previews are off unless the agent's configuration says enabled = true under [preview]",
      PreviewCamera);
  app->add_option("camera", options->camera, "Name of the camera")->required()->type_name("CAMERA");
  AddOption(app, "--output", "FILE", &options->file, "File to write; without it CAMERA.jpg");
  AddFormerOption(app, "--out", "--output");
  AddForceOption(app, &options->force);
  AddOption(app, "--rig", "RIG", &options->rig,
            "Rig of the camera, if several have one of that name");
}

}  // namespace

void AddSessionCommands(CommandParser& parser) {
  CLI::App* group =
      parser.AddGroup("session", "Sessions: one wave of the wand each (create, start, stop, ...)");
  AddCreate(parser, group);
  AddIdCommand(parser, group, "start", "Begin to capture", StartSession);
  AddStop(parser, group);
  auto [list, list_options] =
      parser.AddCommand(group, "list", "Sessions, newest first", ListSessions);
  AddListOptions(list, "state=STATE_FINISHED", "create_time or id", list_options);
  auto [get, shown] = parser.AddCommand(
      group, "get", "One session with its cameras and what was refused", GetSession);
  get->alias("show");
  AddArgument(get, "SESSION", kSessionHelp, &shown->id);
  get->add_flag("--all", shown->all,
                "Every camera; without it those of a rig of more than 16 that need something");
  AddIdCommand(parser, group, "verify",
               "Prove that everything detected is on the server and can be read, or was counted as "
               "dropped; else say which rows are where (exit code 5)",
               VerifySessionStreams);
  auto [remove, removed] =
      parser.AddCommand(group, "delete", "Remove a session and its observations", DeleteSession);
  AddArgument(remove, "SESSION", kSessionHelp, &removed->id);
  AddYesOption(remove, &removed->yes);
  AddDiscard(parser, group);
  AddResume(parser, group);
  AddPrune(parser, group);
  AddIdCommand(parser, group, "watch",
               "A line now and after each change, until it is finished (JSON: one object per line)",
               WatchSession);
  AddObservations(parser, group);

  CLI::App* agents =
      parser.AddGroup("agent", "Agents: the programs beside the cameras (list, preview, forget)");
  auto [agent_list, agent_options] = parser.AddCommand(
      agents, "list", "Agents that are or were connected, with their cameras", ListAgents);
  AddListOptions(agent_list, "connected=true", "agent_id or connect_time", agent_options);
  AddPreview(parser, agents);
  auto [forget, name] = parser.AddCommand(
      agents, "forget", "Refuse an agent that has joined from another PC from now on", ForgetAgent);
  AddArgument(forget, "NAME", "Name of the agent", name);
}

}  // namespace rigcal::client
