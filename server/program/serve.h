// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include "absl/status/statusor.h"
#include "common/config/server_config.h"
#include "server/program/server_flags.h"

namespace rigcal::server {

// Blocks the signals that end a server or set its log level, in this thread and all that it starts,
// so that sigwait gets them. `has_config`: its file is read again on SIGHUP.
sigset_t BlockSignals(bool has_config);

// How a run of the server has ended.
enum class ServeEnd {
  kStopped,
  kReplaced,  // another server writes: this one may wait for its turn again
};

// Builds a server of its parts and runs it until a signal ends it or another server takes its
// place. `config.listen` gets the port where it serves.
absl::StatusOr<ServeEnd> Serve(ServerConfig& config, const ServerFlags& flags);

}  // namespace rigcal::server
