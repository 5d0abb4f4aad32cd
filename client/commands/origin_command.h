// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/commands/command_context.h"
#include "common/origin/origin.h"

namespace rigcal::client {

class CommandParser;

struct OriginCommandOptions {
  std::string calibration;  // id, or the path of a file
  std::string output;       // calibration.json to write
  // One of these is given.
  std::string floor;   // folder of rows: a wand that lies on the floor at several places
  std::string points;  // file of named points; seen in `data`, or static points of the calibration
  std::string path;    // folder of rows: a path in one plane
  std::string down;    // "X,Y,Z"
  std::string transform;  // "X,Y,Z,QW,QX,QY,QZ"
  std::string data;       // folder of rows, with `points`
  double height_m = 0;    // of the markers' centres above the floor
  double still_s = 0.5;
  double sigma_px = 0;  // 0: as the calibration's residuals scatter
  OriginOptions origin;
};

// `rigcal calibration origin`: the same calibration in another frame, written as a file. Returns
// the exit code.
ExitCode SetOrigin(const OriginCommandOptions& options, CommandContext& context);

// Adds it to a group of commands.
void AddOriginCommand(CommandParser& parser, CLI::App* group);

}  // namespace rigcal::client
