// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "server/session/agent_directory.h"

namespace rigcal::server {

// The connected camera of that name; `rig` empty: of the one rig that has it.
//   INVALID_ARGUMENT     no camera is named, a name is not valid, or several rigs have it
//   NOT_FOUND            no agent has announced it; names those that are connected
//   FAILED_PRECONDITION  its agent is not connected
absl::StatusOr<AgentDirectory::ConnectedCamera> FindCamera(const AgentDirectory& directory,
                                                           const std::string& rig,
                                                           const std::string& camera);

}  // namespace rigcal::server
