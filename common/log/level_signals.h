// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include <functional>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal {

// The level of the log changes while a program runs: SIGUSR1 logs more (info, debug, trace),
// SIGUSR2 logs less, SIGHUP takes the level of the configuration file.

// Adds the signals to those that a program waits for. SIGHUP only with `has_config`: without a file
// it ends a program, as when its terminal is closed.
void AddLevelSignals(bool has_config, sigset_t* signals);

// True: `signal` is one of these, the level is changed, and a line says so. `read_level` reads the
// level from the file; where it fails the level stays, and the line says why.
bool TakeLevelSignal(int signal, const std::function<absl::StatusOr<std::string>()>& read_level);

}  // namespace rigcal
