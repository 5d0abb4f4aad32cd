// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "common/board/board.h"

namespace rigcal::client {

struct BoardCommandOptions {
  Board board;
  std::string output;  // of `print`: the SVG file
  bool force = false;
};

// `rigcal board show`: what the board is, how large, how to print it.
ExitCode ShowBoard(const BoardCommandOptions& options, CommandContext& context);
// `rigcal board print`: an SVG file to scale.
ExitCode PrintBoard(const BoardCommandOptions& options, CommandContext& context);

}  // namespace rigcal::client
