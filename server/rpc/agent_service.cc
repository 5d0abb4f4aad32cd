// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/agent_service.h"

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/agent_wire.h"
#include "server/rpc/call_guard.h"
#include "server/rpc/list_arguments.h"

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
    if (term.field == "connected") {
      if (term.value != "true" && term.value != "false") {
        return absl::InvalidArgumentError(
            absl::StrCat("filter: connected is '", term.value, "'; it is true or false"));
      }
      if (agent.connected != (term.value == "true")) return false;
      continue;
    }
    const std::string& value = term.field == "agent_id" ? agent.agent_id
                               : term.field == "rig"    ? agent.rig
                                                        : agent.host;
    if (value != term.value) return false;
  }
  return true;
}

RecordPosition PositionOf(const AgentRecord& agent) {
  return {.time = agent.connect_utc_ns, .id = agent.agent_id};
}

}  // namespace

grpc::Status AgentService::ListAgents(grpc::ServerContext* /*context*/,
                                      const v1::ListAgentsRequest* request,
                                      v1::ListAgentsResponse* response) {
  return GuardedCall("ListAgents", [&]() -> absl::Status {
    RIGCAL_ASSIGN_OR_RETURN(const ListArguments list, ParseListArguments(*request, kAgentFields));
    std::vector<AgentRecord> agents = directory_.List("");
    std::sort(agents.begin(), agents.end(), [&](const AgentRecord& a, const AgentRecord& b) {
      return Precedes(PositionOf(a), PositionOf(b), list.order);
    });
    PageFiller page(list);
    for (const AgentRecord& agent : agents) {
      const RecordPosition position = PositionOf(agent);
      if (list.after && !Precedes(*list.after, position, list.order)) continue;
      RIGCAL_ASSIGN_OR_RETURN(const bool matches, Matches(agent, list.filter));
      if (!matches) continue;
      if (page.full()) {
        response->set_next_page_token(page.NextToken());
        break;
      }
      v1::Agent proto = wire::ToProto(agent);
      page.Add(position, proto.ByteSizeLong());
      *response->add_agents() = std::move(proto);
    }
    return absl::OkStatus();
  });
}

}  // namespace rigcal::server
