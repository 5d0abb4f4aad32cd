// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include "client/commands/agent_command.h"
#include "client/commands/agent_preview_command.h"
#include "client/commands/command_parser.h"
#include "client/commands/session_command.h"
#include "client/commands/session_observations_command.h"

namespace rigcal::client {
namespace {

constexpr double kMaxDrainTimeoutS = 600;

using SessionIdCommand = ExitCode (*)(const std::string&, CommandContext&);

// A command whose only argument is a session.
void AddIdCommand(CommandParser& parser, CLI::App* group, const std::string& name,
                  const std::string& description, SessionIdCommand command) {
  const auto id = std::make_shared<std::string>();
  CLI::App* app =
      parser.AddCommand(group, name, description,
                        [id, command](CommandContext& context) { return command(*id, context); });
  app->add_option("SESSION", *id, "Id of the session")->type_name("")->required();
}

void AddCreate(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<SessionCreateOptions>();
  CLI::App* app = parser.AddCommand(
      group, "create", "Make a session, and with --start begin to capture",
      [options](CommandContext& context) { return CreateSession(*options, context); });
  AddTargetOption(app, /*required=*/true, &options->target);
  app->add_option("--id", options->id,
                  "Id of the session: letters, digits, '_', '-'; without it the server makes one")
      ->type_name("ID");
  app->add_option("--rig", options->rig, "Rig that is captured; without it \"rig\"")
      ->type_name("RIG");
  app->add_option("--title", options->title, "A line for people")->type_name("TEXT");
  app->add_option("--camera", options->cameras,
                  "Cameras that take part; without it all that are connected at the start")
      ->type_name("NAME")
      ->delimiter(',');
  app->add_flag("--start", options->start, "Start it at once");
}

void AddStop(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<SessionStopOptions>();
  CLI::App* app = parser.AddCommand(
      group, "stop", "End the capture; what is still on its way is waited for",
      [options](CommandContext& context) { return StopSession(*options, context); });
  app->add_option("SESSION", options->id, "Id of the session")->type_name("")->required();
  app->add_option("--drain-timeout", options->drain_timeout_s,
                  "How long the server waits for the agents; without it 10 s")
      ->type_name("SECONDS")
      ->check(NumberBetween(0, kMaxDrainTimeoutS));
  app->add_flag("--wait", options->wait, "Return when the session is finished");
}

void AddObservations(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<SessionObservationsOptions>();
  CLI::App* app = parser.AddCommand(
      group, "observations",
      "Write what is stored as CSV: camera,stream_epoch,seq,clock_epoch,time_ns and x,y of each "
      "marker (empty: not visible), in the order (camera, stream_epoch, seq); as JSON one batch "
      "per line",
      [options](CommandContext& context) { return WriteSessionObservations(*options, context); });
  app->add_option("SESSION", options->session, "Id of the session")->type_name("")->required();
  app->add_option("--camera", options->camera, "This camera only")->type_name("NAME");
  app->add_flag("--include-late", options->include_late,
                "Also what came after the session was finished");
}

void AddPreview(CommandParser& parser, CLI::App* group) {
  const auto options = std::make_shared<AgentPreviewOptions>();
  CLI::App* command = parser.AddCommand(
      group, "preview",
      "What a camera that captures sees now, with what its agent's detector makes of it, as a JPEG "
      "file. Previews are off unless the agent's configuration says enabled = true under [preview]",
      [options](CommandContext& context) { return PreviewCamera(*options, context); });
  command->add_option("camera", options->camera, "Name of the camera")
      ->required()
      ->type_name("CAMERA");
  command->add_option("--out", options->file, "File to write; without it CAMERA.jpg")
      ->type_name("FILE");
  command->add_option("--rig", options->rig, "Rig of the camera, if several have one of that name")
      ->type_name("RIG");
}

}  // namespace

void AddSessionCommands(CommandParser& parser) {
  CLI::App* group =
      parser.AddGroup("session", "Sessions: one wave of the wand each (create, start, stop, ...)");
  AddCreate(parser, group);
  AddIdCommand(parser, group, "start", "Begin to capture", StartSession);
  AddStop(parser, group);
  const auto list = std::make_shared<ListOptions>();
  AddListOptions(
      parser.AddCommand(group, "list", "Sessions, newest first",
                        [list](CommandContext& context) { return ListSessions(*list, context); }),
      "state=STATE_FINISHED", "create_time or id", list.get());
  AddIdCommand(parser, group, "get", "One session with its cameras and what was refused",
               GetSession);
  AddIdCommand(parser, group, "delete", "Remove a session and its observations", DeleteSession);
  AddIdCommand(parser, group, "watch",
               "A line now and after each change, until it is finished (JSON: one object per line)",
               WatchSession);
  AddObservations(parser, group);

  CLI::App* agents =
      parser.AddGroup("agent", "Agents: the programs beside the cameras (list, preview)");
  const auto agent_list = std::make_shared<ListOptions>();
  AddListOptions(
      parser.AddCommand(
          agents, "list", "Agents that are or were connected, with their cameras",
          [agent_list](CommandContext& context) { return ListAgents(*agent_list, context); }),
      "connected=true", "agent_id or connect_time", agent_list.get());
  AddPreview(parser, agents);
}

}  // namespace rigcal::client
