// SPDX-License-Identifier: Apache-2.0
#include "server/session/monitor_settings.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/status/status_macros.h"
#include "common/text/nesting.h"

namespace rigcal::server {
namespace {

std::optional<MonitorMode> MonitorModeOf(std::string_view name) {
  for (const MonitorMode mode : {MonitorMode::kOff, MonitorMode::kWatch, MonitorMode::kRepair}) {
    if (MonitorModeName(mode) == name) return mode;
  }
  return std::nullopt;
}

}  // namespace

std::string_view MonitorModeName(MonitorMode mode) {
  switch (mode) {
    case MonitorMode::kWatch:
      return "watch";
    case MonitorMode::kRepair:
      return "repair";
    case MonitorMode::kOff:
      break;
  }
  return "off";
}

absl::StatusOr<std::unique_ptr<MonitorSettings>> MonitorSettings::Open(std::filesystem::path file) {
  std::unique_ptr<MonitorSettings> settings(new MonitorSettings(std::move(file)));
  RIGCAL_RETURN_IF_ERROR(settings->Read());
  return settings;
}

absl::Status MonitorSettings::Read() {
  std::error_code error;
  if (file_.empty() || !std::filesystem::exists(file_, error)) return absl::OkStatus();
  try {
    std::ifstream stream(file_);
    const std::string text{std::istreambuf_iterator<char>(stream), {}};
    const auto file = ParseJson<nlohmann::json>(text);
    for (const auto& [rig, name] : file.at("rigs").items()) {
      const std::optional<MonitorMode> mode = MonitorModeOf(name.get<std::string>());
      if (!mode) throw std::runtime_error(absl::StrCat("rig ", rig, " has an unknown mode"));
      if (*mode != MonitorMode::kOff) modes_[rig] = *mode;
    }
  } catch (const std::exception& fault) {
    return absl::DataLossError(absl::StrCat(file_.string(), " is damaged: ", fault.what(),
                                            "; restore it from a backup, or remove it: then no rig "
                                            "is monitored until it is asked for"));
  }
  return absl::OkStatus();
}

MonitorMode MonitorSettings::Of(std::string_view rig) const {
  const std::lock_guard lock(mutex_);
  const auto found = modes_.find(rig);
  return found == modes_.end() ? MonitorMode::kOff : found->second;
}

std::map<std::string, MonitorMode> MonitorSettings::All() const {
  const std::lock_guard lock(mutex_);
  return {modes_.begin(), modes_.end()};
}

absl::Status MonitorSettings::Set(const std::string& rig, MonitorMode mode) {
  const std::lock_guard lock(mutex_);
  auto modes = modes_;
  if (mode == MonitorMode::kOff) {
    modes.erase(rig);
  } else {
    modes[rig] = mode;
  }
  if (!file_.empty()) {
    nlohmann::json rigs = nlohmann::json::object();
    for (const auto& [name, its_mode] : modes) rigs[name] = std::string(MonitorModeName(its_mode));
    RIGCAL_RETURN_IF_ERROR(WriteDurableFile(file_, nlohmann::json{{"rigs", rigs}}.dump(2) + "\n"));
  }
  modes_ = std::move(modes);
  return absl::OkStatus();
}

}  // namespace rigcal::server
