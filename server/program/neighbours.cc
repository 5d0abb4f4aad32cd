// SPDX-License-Identifier: Apache-2.0
#include "server/program/neighbours.h"

#include <filesystem>
#include <utility>

#include "common/status/status_macros.h"
#include "server/http/web_server.h"
#include "server/listen/port_file.h"
#include "server/program/own_addresses.h"
#include "server/program/part_options.h"
#include "server/store/factory/open_store.h"

namespace rigcal::server {

absl::StatusOr<Neighbours> FindNeighbours(const ServerConfig& config) {
  if (config.store.empty()) return Neighbours();
  Neighbours neighbours;
  RIGCAL_ASSIGN_OR_RETURN(neighbours.roster,
                          OpenServerRoster(config.store, {.unsafe = config.store_unsafe},
                                           OwnEntry(config, 0, nullptr)));
  neighbours.files = std::make_unique<SharedFiles>(config.data_dir, neighbours.roster.get());
  return neighbours;
}

absl::StatusOr<WaitingPorts> OpenWaitingPorts(const ServerConfig& config, const ServerFlags& flags,
                                              ServerRoster* roster, AuditLog* audit,
                                              const Refusal& refusal) {
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
  WaitingPorts ports;
  ports.rpc =
      std::make_unique<RefusingServer>(RpcOptions(config, identity).endpoint, audit, refusal);
  RIGCAL_ASSIGN_OR_RETURN(const int port, ports.rpc->Start());
  const auto notice = [roster] {
    WaitingNotice result{.message = "Another server of this database answers.", .active_page = ""};
    for (const ServerEntry& server : roster->List()) {
      if (server.active) result.active_page = server.page;
    }
    return result;
  };
  WebServerOptions web = WebOptions(config);
  web.waiting = notice;
  RIGCAL_ASSIGN_OR_RETURN(ports.web, WebServer::Open(std::move(web)));
  RIGCAL_RETURN_IF_ERROR(ports.web->Start(port, {}));
  ports.rpc_port = port;
  if (!flags.http_port_file.empty()) {
    RIGCAL_RETURN_IF_ERROR(WritePortFile(flags.http_port_file, ports.web->port()));
  }
  if (!flags.port_file.empty()) RIGCAL_RETURN_IF_ERROR(WritePortFile(flags.port_file, port));
  RIGCAL_RETURN_IF_ERROR(roster->Describe(OwnEntry(config, port, ports.web.get())));
  return ports;
}

}  // namespace rigcal::server
