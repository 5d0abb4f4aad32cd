// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/rpc/replication_client.h"
#include "server/rpc/rpc_endpoint.h"

namespace rigcal::server {

struct StandbyServerOptions {
  RpcEndpointOptions endpoint = {};
  // Why nothing is served, and HOST:PORT of the server that is to be asked (empty: it is not
  // known): the message of every refusal.
  std::string reason = {};
  std::string active_server = {};
  // Takes over; `force`: whatever the primary does. Unset: this server cannot.
  std::function<absl::StatusOr<Promotion>(bool force)> promote = {};
};

// The ports of a server that must not serve: a standby, or one that was replaced. A RefusingServer
// that answers Promote, and says to other standbys why it is not to be followed.
class StandbyServer {
 public:
  explicit StandbyServer(StandbyServerOptions options);
  ~StandbyServer();

  // The errors of RpcEndpoint::AddTo.
  absl::StatusOr<int> Start();
  void Shutdown();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rigcal::server
