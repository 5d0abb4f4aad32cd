// SPDX-License-Identifier: Apache-2.0
#include "server/program/roles.h"

#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <cstdint>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/program/own_addresses.h"
#include "server/program/part_options.h"
#include "server/program/serve.h"
#include "server/replica/data_role.h"
#include "server/standby/standby.h"

namespace rigcal::server {
namespace {

// Again and again where several servers of one database take turns.
absl::Status ServeInTurns(ServerConfig& config, const ServerFlags& flags) {
  while (true) {
    const absl::StatusOr<ServeEnd> end = Serve(config, flags);
    if (end.ok() && *end == ServeEnd::kStopped) return absl::OkStatus();
    // Another one was the first to take over.
    const bool waits_again = end.ok() || (absl::IsAborted(end.status()) && !config.store.empty());
    if (!waits_again) return end.status();
  }
}

// The same ports as those of a server.
absl::StatusOr<StandbyOptions> StandbyOf(const ServerConfig& config, const ServerFlags& flags) {
  RIGCAL_ASSIGN_OR_RETURN(const std::filesystem::path identity, PrepareIdentity(config));
  return StandbyOptions{.primary = config.follow,
                        .data_dir = config.data_dir,
                        .store = {.min_free_bytes = uint64_t{config.limits.disk_reserve_mb} << 20},
                        .server = {.endpoint = RpcOptions(config, identity).endpoint},
                        .web = WebOptions(config),
                        .port_file = flags.port_file,
                        .http_port_file = flags.http_port_file,
                        .own_name = OwnName(config.listen)};
}

}  // namespace

absl::Status ServeInRole(ServerConfig config, const ServerFlags& flags) {
  sigset_t wake;
  sigemptyset(&wake);
  sigaddset(&wake, SIGRTMIN);
  pthread_sigmask(SIG_BLOCK, &wake, nullptr);
  BlockSignals(!flags.config_file.empty());
  while (true) {
    RIGCAL_ASSIGN_OR_RETURN(const DataRole role, ReadDataRole(config.data_dir));
    if (!config.follow.empty()) {
      RIGCAL_ASSIGN_OR_RETURN(const StandbyOptions options, StandbyOf(config, flags));
      RIGCAL_ASSIGN_OR_RETURN(const StandbyEnd end, RunStandby(options));
      if (end == StandbyEnd::kStopped) return absl::OkStatus();
      // What was asked for at the start is done.
      config.follow.clear();
      continue;
    }
    if (role.role == RoleOfData::kStandby) {
      return absl::FailedPreconditionError(absl::StrCat(
          config.data_dir, " is the data folder of a standby of ", role.primary,
          ": start it with --follow ", role.primary, ", or make it take over: rigcal-server ",
          "promote --data-dir ", config.data_dir));
    }
    if (role.role == RoleOfData::kSuperseded) {
      RIGCAL_ASSIGN_OR_RETURN(StandbyOptions options, StandbyOf(config, flags));
      options.server.active_server = role.superseded_by;
      options.server.reason = WhyNotToServe(role);
      return RunRefusing(options);
    }
    RIGCAL_RETURN_IF_ERROR(ServeInTurns(config, flags));
    RIGCAL_ASSIGN_OR_RETURN(const DataRole now, ReadDataRole(config.data_dir));
    if (now.role != RoleOfData::kSuperseded) return absl::OkStatus();
  }
}

}  // namespace rigcal::server
