// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/command_line/command_line.h"
#include "common/config/server_config.h"
#include "common/failpoint/failpoint.h"
#include "common/log/start_log.h"
#include "common/text/printable.h"
#include "common/wire/grpc_locks.h"
#include "common/wire/protocol_version.h"
#include "server/care/care_commands.h"
#include "server/program/roles.h"
#include "server/program/server_flags.h"
#include "server/standby/promote_command.h"

namespace rigcal::server {
namespace {

// On stderr whatever the log level.
int Refuse(const absl::Status& status, int exit_code) {
  std::fprintf(stderr, "rigcal-server: %s\n",
               PrintableLines(std::string(status.message())).c_str());
  return exit_code;
}

int Run(int argc, char** argv) {
  ServerFlags flags;
  CLI::App app(
      "Receives observations from capture agents, stores them, and calibrates the rig.\n"
      "Listens on this machine only; on other addresses with TLS, for clients that have joined.",
      "rigcal-server");
  AddServerFlags(&app, &flags);
  CareCommands care(&app);
  const PromoteCommand promote(&app);
  AddVersionFlags(app, std::string(wire::kSoftwareVersion));
  const auto task = ParseCommandLine(app, argc, argv, std::cout);
  if (!task.ok()) return Refuse(task.status(), kUsageExitCode);
  if (*task == CommandLineTask::kDone) return 0;

  wire::TakeLocksWithoutChecks();
  StartLog("rigcal-server");
  absl::Status status = ActivateFailpoints();
  const absl::Status addresses = CheckAddresses(flags);
  if (!addresses.ok()) return Refuse(addresses, kUsageExitCode);
  const absl::StatusOr<ServerConfig> config = ReadConfig(flags);
  if (!status.ok()) {
    // Said below.
  } else if (!config.ok()) {
    status = config.status();
  } else {
    status = SetLogLevel(config->log_level);
    if (status.ok() && care.chosen()) return care.Run(config->data_dir, config->store);
    if (status.ok() && promote.chosen()) return promote.Run(config->data_dir);
    if (status.ok()) status = SetLogFormat(config->log_format);
    if (status.ok()) status = ServeInRole(*config, flags);
  }
  return status.ok() ? 0 : Refuse(status, 1);
}

}  // namespace
}  // namespace rigcal::server

int main(int argc, char** argv) {
  try {
    return rigcal::server::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rigcal-server: unexpected error: %s\n", error.what());
    return 1;
  }
}
