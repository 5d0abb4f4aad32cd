// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "client/commands/command_parser.h"

namespace rigcal::client {

struct WatchOptions {
  bool all = false;     // as LiveScreenOptions
  std::string rig;      // empty: "rig"
  std::string session;  // empty: none in particular; else its rig, until it has finished
};

// `rigcal watch`: the live state on the whole terminal, until q is pressed or a signal comes; s
// stops the session. Where stdin or stdout is no terminal a line each second (as JSON: the whole
// state), until the session has finished or nobody reads any more. Once it has reached the server
// it tries again and again when that goes away.
ExitCode WatchLive(const WatchOptions& options, CommandContext& context);

void AddWatchCommand(CommandParser& parser);

}  // namespace rigcal::client
