// SPDX-License-Identifier: Apache-2.0
#include "client/commands/server_command.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "client/net/server_connection.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"
#include "rigcal/v1/status_service.grpc.pb.h"

namespace rigcal::client {
namespace {

constexpr uint32_t kSilentMs = 3'000;  // three signs of life are missing

std::string StateOf(const v1::ServerInfo& server) {
  if (server.silent_ms() >= kSilentMs) {
    return absl::StrCat("silent for ", FormatDuration(server.silent_ms() / 1e3));
  }
  return server.active() ? "active" : "waits";
}

std::string FormatServers(const v1::GetStatusResponse& status) {
  TextTable table;
  table.Words({"STATE", "ADDRESS", "PC", "VERSION", "DASHBOARD"});
  for (const v1::ServerInfo& server : status.servers()) {
    table.AddRow({StateOf(server), server.address(), server.host(), server.software_version(),
                  server.page()});
  }
  return table.Format();
}

}  // namespace

ExitCode ListServers(const NoOptions&, CommandContext& context) {
  ServerConnection server(context.server);
  auto status = server.Call(&v1::StatusService::Stub::GetStatus, v1::GetStatusRequest());
  // It has its store for itself, and says nothing of others.
  if (status.ok() && status->servers().empty()) {
    v1::ServerInfo* only = status->add_servers();
    only->set_address(server.address());
    only->set_software_version(status->software_version());
    *only->mutable_start_time() = status->start_time();
    only->set_active(true);
  }
  return context.Show(status, FormatServers);
}

void AddServerCommands(CommandParser& parser) {
  CLI::App* group = parser.AddGroup("server", "The servers of the database (list)");
  parser.AddCommand(group, "list",
                    "Servers that share a database: which one is active, and which ones wait to "
                    "take over",
                    ListServers);
}

}  // namespace rigcal::client
