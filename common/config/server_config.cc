// SPDX-License-Identifier: Apache-2.0
#include "common/config/server_config.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr std::array kServerLogLevels = {"trace", "debug", "info", "warn", "error", "off"};

// Each limit: where it goes, and the most that can be meant.
struct LimitKey {
  const char* key;
  uint32_t ServerLimits::*value;
  int64_t most;
};
constexpr LimitKey kLimitKeys[] = {
    {"max_agents", &ServerLimits::max_agents, 10'000},
    {"max_cameras_per_agent", &ServerLimits::max_cameras_per_agent, 1'000},
    {"max_sessions", &ServerLimits::max_sessions, 1'000'000},
    {"max_cameras_per_session", &ServerLimits::max_cameras_per_session, 1'000},
    {"max_watches", &ServerLimits::max_watches, 1'000},
    {"max_queued_calibrations", &ServerLimits::max_queued_calibrations, 1'000},
    {"max_calibration_observations", &ServerLimits::max_calibration_observations, 1'000'000'000},
    {"ingest_queue_mb", &ServerLimits::ingest_queue_mb, 4'000},
    {"send_window_rows", &ServerLimits::send_window_rows, 1'000'000'000},
    {"rpc_memory_mb", &ServerLimits::rpc_memory_mb, 1'000'000},
};

// PORT is a number up to 65535; what HOST may be is for those who listen to say.
bool IsHostAndPort(const std::string& address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  const std::string port = address.substr(colon + 1);
  return !port.empty() && port.size() <= 5 &&
         port.find_first_not_of("0123456789") == std::string::npos && std::stoi(port) <= 65535;
}

void ReadLimits(TomlFile* file, TomlSection& root, ServerLimits* limits) {
  const toml::node* node = root.TakeNode("limits");
  if (node == nullptr) return;
  if (node->as_table() == nullptr) return root.AddFault("limits", "must be written as [limits]");
  TomlSection section(file, *node->as_table());
  for (const LimitKey& limit : kLimitKeys) {
    int64_t value = 0;
    if (!section.Take(limit.key, &value)) continue;
    if (value < 1 || value > limit.most) {
      section.AddFault(limit.key, absl::StrCat("is ", value, ", must be within 1 to ", limit.most));
      continue;
    }
    limits->*limit.value = static_cast<uint32_t>(value);
  }
  section.RefuseOtherKeys();
}

}  // namespace

absl::StatusOr<ServerConfig> ReadServerConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  const toml::table root = std::exchange(file.root, {});
  ServerConfig config;
  TomlSection section(&file, root);
  if (section.Take("listen", &config.listen) && !IsHostAndPort(config.listen)) {
    section.AddFault("listen", absl::StrCat("\"", config.listen,
                                            "\" is not HOST:PORT; example: \"127.0.0.1:7420\""));
  }
  if (section.Take("data_dir", &config.data_dir)) {
    if (config.data_dir.empty()) section.AddFault("data_dir", "must not be empty");
    const auto folder = std::filesystem::path(path).parent_path();
    config.data_dir = (folder / config.data_dir).lexically_normal().string();
  }
  if (section.Take("log_level", &config.log_level) &&
      std::find(kServerLogLevels.begin(), kServerLogLevels.end(), config.log_level) ==
          kServerLogLevels.end()) {
    section.AddFault("log_level",
                     absl::StrCat("must be one of ", absl::StrJoin(kServerLogLevels, ", ")));
  }
  ReadLimits(&file, section, &config.limits);
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
      "there is no place for the data: neither XDG_DATA_HOME nor HOME is set; give --data-dir");
}

}  // namespace rigcal
