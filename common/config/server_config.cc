// SPDX-License-Identifier: Apache-2.0
#include "common/config/server_config.h"

#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "common/config/shared_options.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

void AddOptions(ServerLimits* limits, OptionTable* table) {
  const auto add = [&](const char* name, uint32_t* value, double most, const char* meaning) {
    table->Add(name, value, {1, most}, meaning);
  };
  add("max_agents", &limits->max_agents, 10'000, "connected at a time");
  add("max_cameras_per_agent", &limits->max_cameras_per_agent, 1'000, "");
  add("max_sessions", &limits->max_sessions, 1'000'000, "kept, finished ones included");
  add("max_cameras_per_session", &limits->max_cameras_per_session, 1'000, "");
  add("max_watches", &limits->max_watches, 1'000, "of each kind");
  add("max_readers", &limits->max_readers, 1'000, "clients that read observations");
  add("max_queued_calibrations", &limits->max_queued_calibrations, 1'000, "");
  add("max_calibration_observations", &limits->max_calibration_observations, 1'000'000'000,
      "in one calibration");
  add("calibration_memory_mb", &limits->calibration_memory_mb, 4'000'000,
      "MiB one calibration may use");
  // Signs of life come several times a second; a machine under load may be late with them.
  table->Add("calibration_silence_s", &limits->calibration_silence_s, {5, 86'400},
             "after which a solve without a sign of life is ended");
  add("ingest_queue_mb", &limits->ingest_queue_mb, 4'000, "MiB waiting for the disk");
  add("send_window_rows", &limits->send_window_rows, 1'000'000'000,
      "unacknowledged, of each camera");
  add("rpc_memory_mb", &limits->rpc_memory_mb, 1'000'000, "MiB for messages and connections");
  add("max_connections", &limits->max_connections, 100'000, "open at a time");
  add("max_connections_per_address", &limits->max_connections_per_address, 100'000, "of them");
  add("disk_reserve_mb", &limits->disk_reserve_mb, 1'000'000,
      "MiB free on the disk at which observations are refused");
}

void AddOptions(RetentionConfig* retention, OptionTable* table) {
  table->Add("max_age_days", &retention->max_age_days, {0, 100'000},
             "since the session finished; 0: no limit");
  table->Add("max_size_mb", &retention->max_size_mb, {0, 4'000'000'000},
             "MiB of the database; 0: no limit");
  table->Add("delete_calibrated", &retention->delete_calibrated,
             "also where a kept calibration was made from them");
}

}  // namespace

absl::StatusOr<ServerConfig> ReadServerConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  ServerConfig config;
  OptionTable options, https, tls, discovery, limits, retention, solve;
  AddAddress("listen", &config.listen, 0, "where the server listens", &options);
  AddAddress("advertise", &config.advertise, 1,
             "that others are told, where it is not that of this PC", &options);
  options.AddPath("data_dir", &config.data_dir, "of the store");
  options.Add("store", &config.store, "postgresql://USER@HOST/DATABASE",
              "the database, where it is not in data_dir");
  options.Add("store_unsafe", &config.store_unsafe, "take a PostgreSQL server with fsync off");
  options.Add("follow", &config.follow, "HOST:PORT", "of the server that this one is a standby of");
  options.AddPath("docs_dir", &config.docs_dir, "of the documentation, for /docs/");
  AddLogLevel(&config.log_level, &options);
  AddLogFormat(&config.log_format, &options);
  bool loopback = false;
  tls.Add("loopback", &loopback, "TLS for clients on this machine too");
  AddAddress("listen", &config.https.listen, 0, "where browsers and other PCs find it", &https);
  https.Add("hosts", &config.https.hosts, "NAME,...",
            "further names under which browsers reach it");
  discovery.Add("mdns", &config.discovery.mdns, "the server announces itself in its network");
  AddOptions(&config.limits, &limits);
  AddOptions(&config.retention, &retention);
  solve.Add("local", &config.solve.local,
            "this server solves calibrations, not only rigcal-workers on its database");
  TomlSection section(&file, file.root);
  section.Take(options);
  if (config.data_dir.empty() && file.root.contains("data_dir")) {
    section.AddFault("data_dir", "must not be empty");
  }
  config.data_dir = ResolvedPath(path, config.data_dir);
  config.docs_dir = ResolvedPath(path, config.docs_dir);
  ReadTable(&file, &section, "tls", tls);
  if (file.root["tls"]["loopback"]) config.tls.loopback = loopback;
  ReadTable(&file, &section, "https", https);
  ReadTable(&file, &section, "discovery", discovery);
  ReadTable(&file, &section, "limits", limits);
  ReadTable(&file, &section, "retention", retention);
  ReadTable(&file, &section, "solve", solve);
  section.RefuseOtherKeys();
  RIGCAL_RETURN_IF_ERROR(file.Result());
  return config;
}

absl::StatusOr<std::string> DefaultDataDirectory() {
  const char* data_home = std::getenv("XDG_DATA_HOME");
  // The XDG base directory specification: a relative path there is to be ignored.
  if (data_home != nullptr && data_home[0] == '/') return absl::StrCat(data_home, "/rigcal");
  const char* home = std::getenv("HOME");
  if (home != nullptr && home[0] != '\0') return absl::StrCat(home, "/.local/share/rigcal");
  return absl::FailedPreconditionError(
      "neither XDG_DATA_HOME nor HOME is set; name a folder for the data with --data-dir");
}

}  // namespace rigcal
