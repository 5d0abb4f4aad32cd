// SPDX-License-Identifier: Apache-2.0
#include "client/command_line.h"

#include "client/commands/command_parser.h"
#include "client/commands/doctor_command.h"
#include "client/watch/watch_command.h"

namespace rigcal::client {

ExitCode RunCommandLine(const std::vector<std::string>& arguments, Console& console) {
  CommandParser parser(console);
  AddLocalCommand(parser);
  AddBoardCommands(parser);
  AddLensCommands(parser);
  AddSessionCommands(parser);
  AddCameraCommands(parser);
  AddWatchCommand(parser);
  AddCalibrationCommands(parser);
  AddRigCommands(parser);
  AddWorkerCommands(parser);
  AddTriangulateCommand(parser);
  AddIdentityCommands(parser);
  AddServerCommands(parser);
  auto [doctor, options] = parser.AddCommand(
      nullptr, "doctor",
      "Look for what is wrong: connection, versions, disk, agents, cameras, sessions", RunDoctor);
  doctor->add_option("SERVER", options->server, "HOST:PORT to look at, as --server")->type_name("");
  doctor
      ->add_option("--bundle", options->bundle,
                   "Write the report, versions, configurations without secrets, the server's state "
                   "and the last lines of the log to a new FILE.tar.gz, for those who maintain "
                   "rigcal; no observations")
      ->type_name("FILE");
  doctor
      ->add_option("--config", options->configs,
                   "A configuration for the bundle; repeatable [those in /etc/rigcal]")
      ->type_name("FILE")
      ->needs("--bundle");
  return parser.Run(arguments);
}

}  // namespace rigcal::client
