// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "server/rpc/agent_stream.h"
#include "server/session/agent_link.h"

namespace rigcal::server {

// The coordinator's way to a stream that may have ended: its commands as messages. Nothing happens
// once it has.
std::shared_ptr<AgentLink> LinkTo(std::weak_ptr<AgentStream> stream);

}  // namespace rigcal::server
