// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <signal.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "server/http/web_server.h"
#include "server/rpc/refusing_server.h"
#include "server/store/server_roster.h"
#include "server/turn/shared_files.h"

namespace rigcal::server {

// The ports of a server that waits: they tell clients and browsers where to go.
struct WaitingPorts {
  std::unique_ptr<RefusingServer> rpc;
  int rpc_port = 0;
  std::unique_ptr<WebServer> web;
};

// How a wait has ended.
struct WaitEnd {
  int signal = 0;            // the one that came; 0: this server has the turn, if it takes it now
  int64_t silent_owner = 0;  // as in ServerRoster::Turn
};

// Waits until no other server has the turn, with the files of the data folder kept up to date.
// `open` makes the ports as soon as there is another server and its files are here; it is given
// what to answer with. `signals` end the wait. Errors: those of the first look, and of `open`.
absl::StatusOr<WaitEnd> WaitForTurn(
    ServerRoster* roster, SharedFiles* files, const sigset_t& signals,
    const std::function<absl::StatusOr<WaitingPorts>(const Refusal&)>& open);

}  // namespace rigcal::server
