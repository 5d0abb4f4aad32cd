// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/statusor.h"

namespace rigcal {

// Upper limits of one server.
struct ServerLimits {
  uint32_t max_agents = 1'024;  // connected at a time
  uint32_t max_cameras_per_agent = 64;
  uint32_t max_sessions = 10'000;  // kept, finished ones included
  uint32_t max_cameras_per_session = 512;
  uint32_t max_watches = 64;  // clients that watch sessions; calibrations the same
  uint32_t max_readers = 16;  // clients that read observations
  uint32_t max_queued_calibrations = 32;
  uint32_t max_calibration_observations = 10'000'000;  // in one calibration
  uint32_t calibration_memory_mb = 12'288;             // MiB one calibration may use
  uint32_t calibration_silence_s = 60;  // after which a solve without a sign of life is ended
  uint32_t ingest_queue_mb = 64;        // MiB of deliveries that wait for the disk
  uint32_t send_window_rows = 32'768;   // unacknowledged, per camera
  uint32_t rpc_memory_mb = 512;         // MiB for messages and connections
  uint32_t max_connections = 2'048;     // open at a time
  uint32_t max_connections_per_address = 256;  // of them
  uint32_t disk_reserve_mb = 256;  // MiB free on the disk at which observations are refused

  friend bool operator==(const ServerLimits&, const ServerLimits&) = default;
};

// [https]: the dashboard, the JSON API, and where other PCs join. With TLS when other PCs can reach
// `listen` of the server, or it is set here; this PC needs none.
struct ServerHttpsConfig {
  std::string listen;  // HOST:PORT; empty: the host of ServerConfig::listen, the port behind its
  std::string hosts;   // further names under which browsers reach it: "rig.lab.org, rig"

  friend bool operator==(const ServerHttpsConfig&, const ServerHttpsConfig&) = default;
};

// [tls]: the ports use TLS as soon as other machines can reach one of them.
struct ServerTlsConfig {
  // Also for clients that come over the loopback address, whoever their user is; the socket file
  // stays open to the server's own user. Unset: as soon as other machines can reach a port.
  std::optional<bool> loopback;

  friend bool operator==(const ServerTlsConfig&, const ServerTlsConfig&) = default;
};

// [discovery]: how PCs of the same network find this server before they join it.
struct ServerDiscoveryConfig {
  bool mdns = false;  // it announces itself, by avahi-daemon

  friend bool operator==(const ServerDiscoveryConfig&, const ServerDiscoveryConfig&) = default;
};

// [retention]: the observations of finished sessions that are deleted by themselves.
struct RetentionConfig {
  uint32_t max_age_days = 0;       // since the session finished; 0: no limit
  uint32_t max_size_mb = 0;        // MiB of the database; 0: no limit
  bool delete_calibrated = false;  // also where a kept calibration was made from them

  friend bool operator==(const RetentionConfig&, const RetentionConfig&) = default;
};

// [solve]: who solves calibrations.
struct ServerSolveConfig {
  bool local = true;  // this server; false: rigcal-workers on its database only

  friend bool operator==(const ServerSolveConfig&, const ServerSolveConfig&) = default;
};

// A server's TOML file: these keys, and tables [https], [tls], [discovery], [limits], [retention]
// and [solve] with the members of ServerHttpsConfig, ServerTlsConfig, ServerDiscoveryConfig,
// ServerLimits (these each at least 1), RetentionConfig and ServerSolveConfig. Every key may be
// left out. Paths are relative to the file's folder.
struct ServerConfig {
  std::string listen = "127.0.0.1:7420";  // HOST:PORT; port 0: any free one
  std::string data_dir;                   // empty: DefaultDataDirectory()
  // Of the database, where that is not in data_dir: postgresql://USER@HOST/DATABASE. Empty: it is.
  std::string advertise;  // HOST:PORT that others are told; empty: from `listen`
  std::string store;
  bool store_unsafe = false;        // take a PostgreSQL server with fsync off
  std::string follow;               // HOST:PORT of the primary of a standby; empty: it is none
  std::string docs_dir;             // of the documentation; empty: where rigcal-doc has it
  std::string log_level = "info";   // trace, debug, info, warn, error, off
  std::string log_format = "auto";  // auto, text, json, journal
  ServerHttpsConfig https;
  ServerTlsConfig tls;
  ServerDiscoveryConfig discovery;
  ServerLimits limits;
  RetentionConfig retention;
  ServerSolveConfig solve;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: every unknown key and every bad value at once, each
// with file and line.
absl::StatusOr<ServerConfig> ReadServerConfig(const std::string& path);

// $XDG_DATA_HOME/rigcal, else ~/.local/share/rigcal. FAILED_PRECONDITION: neither is set.
absl::StatusOr<std::string> DefaultDataDirectory();

}  // namespace rigcal
