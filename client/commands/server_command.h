// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "client/commands/command_context.h"
#include "client/commands/command_parser.h"

namespace rigcal::client {

ExitCode ListServers(const NoOptions& options, CommandContext& context);

}  // namespace rigcal::client
