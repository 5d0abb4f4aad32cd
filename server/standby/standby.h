// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/http/web_server.h"
#include "server/rpc/standby_server.h"
#include "server/store/factory/open_store.h"

namespace rigcal::server {

struct StandbyOptions {
  std::string primary;   // HOST:PORT to follow
  std::string data_dir;  // of this server
  StoreOptions store = {};
  StandbyServerOptions server = {};  // `reason` and `promote` are set here
  WebServerOptions web = {};         // `waiting` is set here
  std::string port_file = {};
  std::string http_port_file = {};
  std::string own_name = {};  // of this PC, for the primary's messages
};

enum class StandbyEnd {
  kStopped,
  kPromoted,  // now, or before and no server that was promoted after it answers: it serves
};

// Runs a standby until a signal ends it or it is promoted. Its ports are open from the beginning:
// they say whom it follows, how far behind it is, and how to promote it. A server that was promoted
// before follows only one with a higher generation that answers within 5 s. The signals SIGTERM,
// SIGINT and SIGRTMIN must be blocked in every thread.
//   FAILED_PRECONDITION  its folder has data that the primary does not have; it is named
//   others               errors of the store and the ports
absl::StatusOr<StandbyEnd> RunStandby(const StandbyOptions& options);

// Runs a server whose data another one has taken over, until a signal ends it: it only says so.
// `options`: primary and store are not used.
absl::Status RunRefusing(const StandbyOptions& options);

}  // namespace rigcal::server
