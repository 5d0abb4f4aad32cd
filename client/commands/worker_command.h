// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "client/commands/command_context.h"

namespace rigcal::client {

// `rigcal worker list`.
struct ListWorkersOptions {};
ExitCode ListWorkers(const ListWorkersOptions& options, CommandContext& context);

}  // namespace rigcal::client
