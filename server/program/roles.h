// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/status.h"
#include "common/config/server_config.h"
#include "server/program/server_flags.h"

namespace rigcal::server {

// Serves as what the data folder says that it is: a server, a standby, or one that was replaced.
// Where several servers of one database take turns, again and again.
absl::Status ServeInRole(ServerConfig config, const ServerFlags& flags);

}  // namespace rigcal::server
