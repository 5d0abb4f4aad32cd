// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/rpc/standby_server.h"
#include "server/store/factory/open_store.h"

namespace rigcal::server {

struct StandbyOptions {
  std::string primary;   // HOST:PORT to follow
  std::string data_dir;  // of this server
  StoreOptions store = {};
  StandbyServerOptions server = {};  // `reason` and `promote` are set here
  std::string port_file = {};
  std::string own_name = {};  // of this PC, for the primary's messages
};

enum class StandbyEnd { kStopped, kPromoted };

// Runs a standby until a signal ends it or it is promoted. The signals SIGTERM, SIGINT and SIGRTMIN
// must be blocked in every thread.
//   FAILED_PRECONDITION  its folder has data that the primary does not have; it is named
//   others               errors of the store and the ports
absl::StatusOr<StandbyEnd> RunStandby(const StandbyOptions& options);

// Runs a server whose data another one has taken over, until a signal ends it: it only says so.
absl::Status RunRefusing(StandbyServerOptions options, const std::string& data_dir,
                         const std::string& port_file);

}  // namespace rigcal::server
