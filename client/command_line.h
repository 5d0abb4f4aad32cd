// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/commands/exit_code.h"
#include "client/output/console.h"

namespace rigcal::client {

// Reads what a user typed behind `rigcal`, and does it. Call it on the main thread.
ExitCode RunCommandLine(const std::vector<std::string>& arguments, Console& console);

}  // namespace rigcal::client
