// SPDX-License-Identifier: Apache-2.0
#include "server/program/part_options.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/status/status_macros.h"
#include "server/http/web_server.h"
#include "server/identity/server_identity.h"
#include "server/listen/descriptor_limit.h"
#include "server/listen/listen_socket.h"

namespace rigcal::server {

bool IsNetworked(const ServerConfig& config) {
  return !IsLoopbackAddress(config.listen) ||
         (!config.https.listen.empty() && !IsLoopbackAddress(config.https.listen));
}

bool HasOpenLoopback(const ServerConfig& config) {
  return !config.tls.loopback.value_or(IsNetworked(config));
}

absl::StatusOr<std::filesystem::path> PrepareIdentity(const ServerConfig& config) {
  std::error_code ignored;
  if (IsLoopbackAddress(config.listen) && HasOpenLoopback(config) && config.https.listen.empty() &&
      !std::filesystem::exists(IdentityDirectory(config.data_dir) / "server.crt", ignored)) {
    return std::filesystem::path();
  }
  RIGCAL_RETURN_IF_ERROR(EnsureServerIdentity(
      config.data_dir, CertificateHosts(config.advertise, config.listen, config.https.listen)));
  return IdentityDirectory(config.data_dir);
}

std::filesystem::path SocketFile(const ServerConfig& config) {
  return std::filesystem::path(config.data_dir) / "rigcal.sock";
}

RpcServerOptions RpcOptions(const ServerConfig& config,
                            const std::filesystem::path& identity_folder) {
  const ServerLimits& limits = config.limits;
  const size_t connections = ConnectionsWithin(RaiseDescriptorLimit(), limits.max_connections);
  if (connections < limits.max_connections) {
    spdlog::warn(
        "at most {} connections, not {}: this process may not open more descriptors; "
        "raise its limit (ulimit -n)",
        connections, limits.max_connections);
  }
  return {.endpoint = {.listen_address = config.listen,
                       .socket_file = SocketFile(config),
                       .identity_folder = identity_folder,
                       .listener = {.plain_loopback = HasOpenLoopback(config),
                                    .limits = {.total = connections,
                                               .per_address = limits.max_connections_per_address}},
                       .memory_limit_bytes = size_t{limits.rpc_memory_mb} << 20},
          // More than agents, for streams that are being replaced.
          .agents = {.max_streams = size_t{limits.max_agents} + 64},
          .readers = {.max_readers = limits.max_readers},
          .ingest_queue_limit_bytes = size_t{limits.ingest_queue_mb} << 20};
}

WebServerOptions WebOptions(const ServerConfig& config) {
  return {.data_dir = config.data_dir,
          .grpc_listen = config.listen,
          .advertised = config.advertise,
          .https_listen = config.https.listen,
          .hosts = HostsOf(config.https.hosts),
          .plain_loopback = HasOpenLoopback(config)};
}

std::vector<std::string> HostsOf(const std::string& text) {
  std::vector<std::string> hosts;
  for (const absl::string_view host : absl::StrSplit(text, ',', absl::SkipWhitespace())) {
    hosts.emplace_back(absl::StripAsciiWhitespace(host));
  }
  return hosts;
}

RetentionOptions RetentionOf(const RetentionConfig& config) {
  return {.max_age = std::chrono::hours(24) * config.max_age_days,
          .max_bytes = uint64_t{config.max_size_mb} << 20,
          .delete_calibrated = config.delete_calibrated};
}

SilenceLimits SilenceLimitsOf(const ServerLimits& limits) {
  SilenceLimits silence;
  silence.end = std::chrono::seconds(limits.calibration_silence_s);
  silence.doubt = std::min(silence.doubt, silence.end / 2);
  return silence;
}

}  // namespace rigcal::server
