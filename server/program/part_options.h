// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/config/server_config.h"
#include "server/http/web_server.h"
#include "server/jobs/signs_of_life.h"
#include "server/rpc/rpc_server.h"
#include "server/session/retention.h"

namespace rigcal::server {

// What the parts of the server take from its configuration.

// Other machines can reach one of the ports.
bool IsNetworked(const ServerConfig& config);

// Clients on this machine need no certificate, whoever their user is.
bool HasOpenLoopback(const ServerConfig& config);

// Makes the keys, where they are needed, and returns their folder; empty: nobody needs them.
// TLS is for whoever is on another machine; on this one it is there for clients that have joined.
absl::StatusOr<std::filesystem::path> PrepareIdentity(const ServerConfig& config);

// Commands on this machine reach the server there without a certificate.
std::filesystem::path SocketFile(const ServerConfig& config);

// The limit on connections is lowered to what this process may open.
RpcServerOptions RpcOptions(const ServerConfig& config,
                            const std::filesystem::path& identity_folder);

// Ports and names of the HTTP server; what it shows is added.
WebServerOptions WebOptions(const ServerConfig& config);

// Names between commas, with spaces around them.
std::vector<std::string> HostsOf(const std::string& text);

RetentionOptions RetentionOf(const RetentionConfig& config);

// With short limits it is said half way.
SilenceLimits SilenceLimitsOf(const ServerLimits& limits);

}  // namespace rigcal::server
