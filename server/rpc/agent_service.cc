// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/agent_wire.h"
#include "common/wire/offer_wire.h"
#include "rigcal/v1/agent_service.grpc.pb.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/list_arguments.h"
#include "server/rpc/services.h"

namespace rigcal::server {
namespace {

constexpr FilterField kAgentFilterFields[] = {{"agent_id"}, {"rig"}, {"host"}, {"connected"}};
constexpr ListFields kAgentFields = {.filter = kAgentFilterFields,
                                     .time_order = "connect_time",
                                     .id_order = "agent_id",
                                     .default_order = RecordOrder::kIdAscending};

absl::StatusOr<bool> Matches(const AgentRecord& agent,
                             const std::vector<ListArguments::Term>& filter) {
  for (const ListArguments::Term& term : filter) {
    if (term.field == "connected" && term.value != "true" && term.value != "false") {
      return absl::InvalidArgumentError(
          absl::StrCat("filter: connected is '", term.value, "'; it is true or false"));
    }
    const std::string value = term.field == "agent_id" ? agent.agent_id
                              : term.field == "rig"    ? agent.rig
                              : term.field == "host"   ? agent.host
                              : agent.connected        ? "true"
                                                       : "false";
    if (value != term.value) return false;
  }
  return true;
}

class AgentService final : public v1::AgentService::Service {
 public:
  AgentService(const AgentDirectory* directory, const CameraChoices* choices)
      : directory_(*directory), choices_(*choices) {}

  grpc::Status ListAgents(grpc::ServerContext*, const v1::ListAgentsRequest* request,
                          v1::ListAgentsResponse* response) override {
    return GuardedCall("ListAgents", [&]() -> absl::Status {
      RIGCAL_ASSIGN_OR_RETURN(const ListArguments list, ParseListArguments(*request, kAgentFields));
      std::vector<Listed<AgentRecord>> agents;
      for (AgentRecord& agent : directory_.List("")) {
        RIGCAL_ASSIGN_OR_RETURN(const bool matches, Matches(agent, list.filter));
        RecordPosition position{.time = agent.connect_utc_ns, .id = agent.agent_id};
        if (!matches || (list.after && !Precedes(*list.after, position, list.order))) continue;
        agents.push_back({std::move(agent), std::move(position)});
      }
      std::sort(agents.begin(), agents.end(), [&](const auto& a, const auto& b) {
        return Precedes(a.position, b.position, list.order);
      });
      const auto describe = [this](const AgentRecord& agent, v1::Agent* proto) {
        *proto = wire::ToProto(agent);
        for (const OfferedCamera& camera : choices_.OffersOf(agent.agent_id)) {
          *proto->add_offered() = wire::ToProto(camera);
        }
        return absl::OkStatus();
      };
      return FillPage(list, agents, describe, response->mutable_agents(),
                      response->mutable_next_page_token());
    });
  }

 private:
  const AgentDirectory& directory_;
  const CameraChoices& choices_;
};

}  // namespace

std::unique_ptr<grpc::Service> MakeAgentService(const RpcServerParts& parts,
                                                const CameraChoices* choices) {
  return std::make_unique<AgentService>(parts.directory, choices);
}

}  // namespace rigcal::server
