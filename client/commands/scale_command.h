// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/commands/command_context.h"

namespace rigcal::client {

class CommandParser;

struct ScaleCommandOptions {
  std::string calibration;             // id, or the path of a file
  std::string output;                  // calibration.json to write
  std::vector<std::string> distances;  // "CAMERA,CAMERA,METRES[,SIGMA_M]"
  std::vector<std::string> lengths;    // "MARKER,MARKER,METRES[,SIGMA_M]", of the rows in `data`
  std::string data;                    // folder of rows
  std::vector<std::string> leave_out;  // names of sources, as reported
  double sigma_px = 0;                 // 0: as the calibration's residuals scatter
};

// `rigcal calibration scale`: the scale from all sources together, written as a file unless one of
// them disagrees. Returns the exit code.
ExitCode FuseScale(const ScaleCommandOptions& options, CommandContext& context);

// Adds it to a group of commands.
void AddScaleCommand(CommandParser& parser, CLI::App* group);

}  // namespace rigcal::client
