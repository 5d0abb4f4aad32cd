// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "common/config/server_config.h"
#include "common/discovery/discovery.h"
#include "server/http/web_server.h"

namespace rigcal::server {

// Once per start: what to type to use this server from elsewhere.
void TellHowToJoin(const WebServer& web);

// Says who on this PC may do everything.
void TellWhoNeedsNoCertificate(const ServerConfig& config);

// Tells the network of this server while the result lives. Null: it is not announced; the log
// says why where it should be. Nothing else depends on it.
std::unique_ptr<Discovery::Announcement> Announce(const ServerConfig& config, int grpc_port,
                                                  WebServer* web);

}  // namespace rigcal::server
