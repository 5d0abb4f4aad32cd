// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/commands/command_context.h"
#include "client/commands/frame_command.h"

namespace rigcal::client {

class CommandParser;

struct ScaleCommandOptions {
  FrameTarget target;
  std::vector<std::string> distances;  // "CAMERA,CAMERA,METRES[,SIGMA_M]"
  std::vector<std::string> lengths;    // "MARKER,MARKER,METRES[,SIGMA_M]", of the rows
  std::string data;                    // folder of rows
  std::vector<std::string> leave_out;  // names of sources, as reported
  double sigma_px = 0;                 // 0: as the calibration's residuals scatter
};

// `rigcal calibration scale` and `rigcal rig scale`: the scale from all sources together, kept on
// the server or written as a file unless one of them disagrees. Returns the exit code.
ExitCode FuseScale(const ScaleCommandOptions& options, CommandContext& context);

// Adds it to a group of commands. `rig`: the argument is a rig.
void AddScaleCommand(CommandParser& parser, CLI::App* group, bool rig);

}  // namespace rigcal::client
