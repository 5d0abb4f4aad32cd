// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "client/commands/exit_code.h"
#include "client/output/console.h"

namespace rigcal::client {

// What every command gets besides its own options.
struct CommandContext {
  Console& console;
  // HOST:PORT.
  std::string server;

  // Says what went wrong; returns the exit code for it.
  ExitCode Fail(const absl::Status& status) {
    console.Error(status);
    return ExitCodeOf(status);
  }
};

}  // namespace rigcal::client
