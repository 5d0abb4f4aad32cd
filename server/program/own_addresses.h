// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "common/config/server_config.h"
#include "server/http/web_server.h"
#include "server/store/server_roster.h"

namespace rigcal::server {

// HOST:PORT of this PC for messages of other servers, with the port of `listen`: "pc-2:7420".
std::string OwnName(const std::string& listen);

// `listen` with this port.
std::string AddressOn(const std::string& listen, int port);

// How commands on this machine reach the server: by its socket file, which never needs a
// certificate, else by the port.
std::string AddressForCommands(const ServerConfig& config, int port);

// As the other servers of the store, and people, are told of this one. The port may not be known
// yet (0), nor its page (null).
ServerEntry OwnEntry(const ServerConfig& config, int port, const WebServer* web);

}  // namespace rigcal::server
