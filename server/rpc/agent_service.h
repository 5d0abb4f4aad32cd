// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rigcal/v1/agent_service.grpc.pb.h"
#include "server/session/agent_directory.h"

namespace rigcal::server {

// rigcal.v1.AgentService.
class AgentService final : public v1::AgentService::Service {
 public:
  explicit AgentService(const AgentDirectory* directory) : directory_(*directory) {}

  grpc::Status ListAgents(grpc::ServerContext* context, const v1::ListAgentsRequest* request,
                          v1::ListAgentsResponse* response) override;

 private:
  const AgentDirectory& directory_;
};

}  // namespace rigcal::server
