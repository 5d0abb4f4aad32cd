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
  add("max_queued_calibrations", &limits->max_queued_calibrations, 1'000, "");
  add("max_calibration_observations", &limits->max_calibration_observations, 1'000'000'000,
      "in one calibration");
  add("ingest_queue_mb", &limits->ingest_queue_mb, 4'000, "MiB waiting for the disk");
  add("send_window_rows", &limits->send_window_rows, 1'000'000'000,
      "unacknowledged, of each camera");
  add("rpc_memory_mb", &limits->rpc_memory_mb, 1'000'000, "MiB for messages and connections");
}

}  // namespace

absl::StatusOr<ServerConfig> ReadServerConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  ServerConfig config;
  OptionTable options, limits;
  AddAddress("listen", &config.listen, 0, "where the server listens", &options);
  options.AddPath("data_dir", &config.data_dir, "of the store");
  AddLogLevel(&config.log_level, &options);
  AddOptions(&config.limits, &limits);
  TomlSection section(&file, file.root);
  section.Take(options);
  if (config.data_dir.empty() && file.root.contains("data_dir")) {
    section.AddFault("data_dir", "must not be empty");
  }
  config.data_dir = ResolvedPath(path, config.data_dir);
  ReadTable(&file, &section, "limits", limits);
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
