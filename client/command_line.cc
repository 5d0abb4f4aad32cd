// SPDX-License-Identifier: Apache-2.0
#include "client/command_line.h"

#include "client/commands/command_parser.h"
#include "client/commands/doctor_command.h"

namespace rigcal::client {

ExitCode RunCommandLine(const std::vector<std::string>& arguments, Console& console) {
  CommandParser parser(console);
  AddLocalCommand(parser);
  AddSessionCommands(parser);
  AddCalibrationCommands(parser);
  parser.AddCommand(nullptr, "doctor",
                    "Look for what is wrong: server, versions, disk, agents, cameras, sessions",
                    RunDoctor);
  return parser.Run(arguments);
}

}  // namespace rigcal::client
