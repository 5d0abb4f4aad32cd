// SPDX-License-Identifier: Apache-2.0
#include "server/program/announcement.h"

#include <pwd.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/identity/server_identity.h"
#include "server/listen/listen_socket.h"
#include "server/program/part_options.h"

namespace rigcal::server {
namespace {

std::string UserName() {
  const passwd* const user = getpwuid(geteuid());
  return user == nullptr ? absl::StrCat(geteuid()) : user->pw_name;
}

}  // namespace

void TellHowToJoin(const WebServer& web) {
  spdlog::info(
      "other PCs join at the HTTPS port {}: `rigcal token create` on this PC prints a join string "
      "for `rigcal-agent join STRING` on a PC with cameras; `rigcal token create --role operator` "
      "one for `rigcal login STRING`",
      web.port());
}

void TellWhoNeedsNoCertificate(const ServerConfig& config) {
  if (HasOpenLoopback(config)) {
    spdlog::warn(
        "every user and program of this PC may do everything here without a certificate ([tls] "
        "loopback = false in the server's configuration)");
  } else {
    spdlog::info(
        "on this PC only user {} needs no certificate (over {}); to open 127.0.0.1 to every user "
        "of it, set [tls] loopback = false in the server's configuration",
        UserName(), SocketFile(config).string());
  }
}

std::unique_ptr<Discovery::Announcement> Announce(const ServerConfig& config, int grpc_port,
                                                  WebServer* web) {
  if (!config.discovery.mdns) return nullptr;
  const auto trouble = [](const std::string& why) {
    spdlog::warn("the server does not announce itself in its network: {}", why);
  };
  if (web->authority() == nullptr || IsLoopbackAddress(config.listen)) {
    trouble("other PCs cannot reach it; start it with --listen 0.0.0.0");
    return nullptr;
  }
  auto announcement = MakeDiscovery()->Announce({.name = OwnHostName(),
                                                 .grpc_port = static_cast<uint16_t>(grpc_port),
                                                 .https_port = static_cast<uint16_t>(web->port())},
                                                trouble);
  if (!announcement.ok()) trouble(std::string(announcement.status().message()));
  return announcement.ok() ? *std::move(announcement) : nullptr;
}

}  // namespace rigcal::server
