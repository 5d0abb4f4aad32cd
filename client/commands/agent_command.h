// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

// `rigcal agent list`: agents that are connected or were since the server started, with their
// cameras. `rig` empty: every rig.
ExitCode ListAgents(const std::string& rig, CommandContext& context);

}  // namespace rigcal::client
