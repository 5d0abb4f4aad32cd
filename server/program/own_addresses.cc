// SPDX-License-Identifier: Apache-2.0
#include "server/program/own_addresses.h"

#include <cstdint>
#include <filesystem>
#include <system_error>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/identity/join_string.h"
#include "common/wire/protocol_version.h"
#include "server/care/running_server.h"
#include "server/identity/server_identity.h"
#include "server/program/part_options.h"
#include "server/session/utc_clock.h"

namespace rigcal::server {
namespace {

// HOST:PORT where others reach a port that listens on `listen`.
std::string AddressForOthers(const std::string& listen, int port) {
  std::string host;
  uint16_t listen_port = 0;
  if (!SplitHostPort(listen, &host, &listen_port)) return listen;
  const std::vector<std::string> hosts = ReachableHosts(host);
  return JoinHostPort(hosts.empty() ? host : hosts.front(),
                      port == 0 ? listen_port : static_cast<uint16_t>(port));
}

}  // namespace

std::string OwnName(const std::string& listen) {
  std::string host;
  uint16_t port = 0;
  SplitHostPort(listen, &host, &port);
  return JoinHostPort(OwnHostName(), port);
}

std::string AddressOn(const std::string& listen, int port) {
  std::string host;
  uint16_t ignored = 0;
  return SplitHostPort(listen, &host, &ignored) ? JoinHostPort(host, static_cast<uint16_t>(port))
                                                : listen;
}

std::string AddressForCommands(const ServerConfig& config, int port) {
  std::error_code error;
  const std::filesystem::path file = std::filesystem::absolute(SocketFile(config), error);
  if (!error && std::filesystem::is_socket(file, error)) return "unix:" + file.string();
  return LocalAddress(config.listen, port);
}

ServerEntry OwnEntry(const ServerConfig& config, int port, const WebServer* web) {
  ServerEntry entry{.host = OwnHostName(),
                    .address = config.advertise.empty() ? AddressForOthers(config.listen, port)
                                                        : config.advertise,
                    .version = std::string(wire::kSoftwareVersion),
                    .start_utc_ns = UtcNowNs({})};
  if (web != nullptr) {
    const bool plain = web->LocalUrl().starts_with("http://");
    entry.page = absl::StrCat(plain ? "http://" : "https://",
                              AddressForOthers(config.listen, web->port()), "/");
  }
  return entry;
}

}  // namespace rigcal::server
