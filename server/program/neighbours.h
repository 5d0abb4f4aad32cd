// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "common/config/server_config.h"
#include "server/audit/audit_log.h"
#include "server/program/server_flags.h"
#include "server/rpc/refusing_server.h"
#include "server/store/server_roster.h"
#include "server/turn/shared_files.h"
#include "server/turn/wait_for_turn.h"

namespace rigcal::server {

// The servers of a database elsewhere, with this one, and the files that they share.
struct Neighbours {
  std::unique_ptr<ServerRoster> roster;  // null: this server has its store for itself
  std::unique_ptr<SharedFiles> files;
};

absl::StatusOr<Neighbours> FindNeighbours(const ServerConfig& config);

// What a server that waits answers with at its ports.
absl::StatusOr<WaitingPorts> OpenWaitingPorts(const ServerConfig& config, const ServerFlags& flags,
                                              ServerRoster* roster, AuditLog* audit,
                                              const Refusal& refusal);

}  // namespace rigcal::server
