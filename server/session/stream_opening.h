// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "common/session/agent.h"
#include "common/session/session.h"
#include "server/session/agent_directory.h"
#include "server/session/capture_orders.h"
#include "server/store/store.h"

// Which streams a session waits for. A camera has ended when all its streams have: so a stream is
// noted in the store as soon as its agent is told to capture, or says that it holds it.
namespace rigcal::server {

// Those that the orders begin or continue.
std::vector<StreamKey> StreamsOf(const std::vector<CaptureOrder>& orders);

// Notes streams of which nothing has come yet; others stay as they are. Errors of Store::Append.
absl::Status OpenStreams(const std::vector<StreamKey>& streams, Store* store);

// Ends the streams of `agent`, a connected one, that it does not have although its spool is on a
// disk, and of which nothing ever came: it ended before it began them. Errors of the store.
absl::Status EndStreamsNeverBegun(const Session& session, const AgentRecord& agent,
                                  const AgentDirectory& directory, Store* store);

}  // namespace rigcal::server
