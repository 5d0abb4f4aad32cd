// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal {

// Upper limits of one server.
struct ServerLimits {
  uint32_t max_agents = 256;  // connected at a time
  uint32_t max_cameras_per_agent = 64;
  uint32_t max_sessions = 10'000;  // kept, finished ones included
  uint32_t max_cameras_per_session = 256;
  uint32_t max_watches = 64;  // clients that watch sessions; calibrations the same
  uint32_t max_queued_calibrations = 32;
  uint32_t max_calibration_observations = 10'000'000;  // in one calibration, about 250 bytes each
  uint32_t ingest_queue_mb = 64;                       // MiB of deliveries that wait for the disk
  uint32_t send_window_rows = 32'768;                  // unacknowledged, per camera
  uint32_t rpc_memory_mb = 512;                        // MiB for messages and connections

  friend bool operator==(const ServerLimits&, const ServerLimits&) = default;
};

// A server's TOML file: these keys, and a table [limits] with the members of ServerLimits, each at
// least 1. Every key may be left out. Paths are relative to the file's folder.
struct ServerConfig {
  std::string listen = "127.0.0.1:7420";  // HOST:PORT; port 0: any free one
  std::string data_dir;                   // empty: DefaultDataDirectory()
  std::string log_level = "info";         // trace, debug, info, warn, error, off
  ServerLimits limits;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<ServerConfig> ReadServerConfig(const std::string& path);

// $XDG_DATA_HOME/rigcal, else ~/.local/share/rigcal. FAILED_PRECONDITION: neither is set.
absl::StatusOr<std::string> DefaultDataDirectory();

}  // namespace rigcal
