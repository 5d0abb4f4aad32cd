// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/commands/command_context.h"
#include "client/commands/frame_command.h"

namespace rigcal::client {

class CommandParser;

struct OriginCommandOptions {
  FrameTarget target;
  // One of these is given.
  std::string floor;           // folder of rows: a wand that lies on the floor at several places
  bool floor_session = false;  // the same of the session
  std::string points;          // file of named points; seen in the rows, or static points
  std::string board;           // text of a printed board that rests; seen in the rows
  std::string path;            // folder of rows: a path in one plane
  bool path_session = false;   // the same of the session
  std::string down;            // "X,Y,Z"
  std::string transform;       // "X,Y,Z,QW,QX,QY,QZ"
  std::string data;            // folder of rows, with `points`
  double sigma_px = 0;         // 0: as the calibration's residuals scatter
  OriginRequest request;       // limits, height
};

// `rigcal calibration origin` and `rigcal rig origin`: the same calibration in another frame, kept
// on the server or written as a file. Returns the exit code.
ExitCode SetOrigin(const OriginCommandOptions& options, CommandContext& context);

// Adds it to a group of commands. `rig`: the argument is a rig.
void AddOriginCommand(CommandParser& parser, CLI::App* group, bool rig);

}  // namespace rigcal::client
