// SPDX-License-Identifier: Apache-2.0
#include "client/commands/worker_command.h"

#include <chrono>

#include "client/commands/command_parser.h"
#include "client/net/server_connection.h"
#include "client/tables/worker_table.h"
#include "rigcal/v1/status_service.grpc.pb.h"

namespace rigcal::client {

ExitCode ListWorkers(const ListWorkersOptions&, CommandContext& context) {
  ServerConnection server(context.server);
  const int64_t now_s = std::chrono::duration_cast<std::chrono::seconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
  return context.Show(
      server.Call(&v1::StatusService::Stub::GetStatus, {}),
      [&](const v1::GetStatusResponse& status) { return FormatWorkerList(status, now_s); });
}

void AddWorkerCommands(CommandParser& parser) {
  CLI::App* group = parser.AddGroup("worker", "Who solves calibrations (list)");
  parser.AddCommand(group, "list",
                    "The processes that solve calibrations: the server, and the rigcal-workers of "
                    "its database",
                    ListWorkers);
}

}  // namespace rigcal::client
