// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "absl/status/statusor.h"
#include "client/commands/command_context.h"
#include "client/commands/list_options.h"
#include "rigcal/v1/agent_service.pb.h"

namespace rigcal::client {

class ServerConnection;

absl::StatusOr<rigcal::v1::ListAgentsResponse> ReadAllAgents(ServerConnection& server,
                                                             const ListOptions& options);

// `rigcal agent list`: agents that are connected or were since the server started, with their
// cameras.
ExitCode ListAgents(const ListOptions& options, CommandContext& context);

}  // namespace rigcal::client
