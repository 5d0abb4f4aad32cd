// SPDX-License-Identifier: Apache-2.0
#include "common/config/agent_config.h"

#include <filesystem>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/config/shared_options.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// The source's own table knows the types.
void TakeSourceOption(TomlFile* file, std::string_view key, const toml::node& value,
                      CameraConfig* camera) {
  absl::StatusOr<OptionText> option = OptionOf(*file, key, value);
  if (!option.ok()) return file->AddFault(value, std::string(option.status().message()));
  if (option->value.empty()) return file->AddFault(value, absl::StrCat(option->key, " is empty"));
  option->type = OptionText::Type::kAny;
  camera->options.push_back(*std::move(option));
}

CameraConfig ReadCamera(TomlFile* file, const toml::table& table) {
  CameraConfig camera;
  camera.where = file->PlaceOf(table);
  camera.folder = std::filesystem::path(file->path).parent_path().string();
  OptionTable options;
  AddName("name", &camera.name, "of the camera within the rig", &options);
  options.Add("source", &camera.source, "SPEC", "where the camera's observations come from");
  TomlSection section(file, table);
  section.Take(options);
  if (!table.contains("source")) {
    file->AddFault(table, "a camera without source; example: source = \"csv:left.csv\"");
  }
  for (const char* key : {"calibration", "speed", "sigma"}) {
    if (const toml::node* node = section.TakeNode(key)) TakeSourceOption(file, key, *node, &camera);
  }
  for (const char* key : {"settings", "detector"}) {
    const toml::node* node = section.TakeNode(key);
    if (node == nullptr) continue;
    if (node->as_table() == nullptr) {
      section.AddFault(key, absl::StrCat("must be written as [camera.", key, "]"));
      continue;
    }
    for (const auto& [name, value] : *node->as_table()) {
      TakeSourceOption(file, name.str(), value, &camera);
    }
  }
  section.RefuseOtherKeys();
  return camera;
}

}  // namespace

void AddOptions(AgentConfig* config, OptionTable* table) {
  AddAddress("server", &config->server, 1, "of the server", table);
  AddName("rig", &config->rig, "of all cameras", table);
  AddName("agent_id", &config->agent_id, "of this agent", table);
  table->AddPath("state_dir", &config->state_dir, "of this agent alone");
  AddLogLevel(&config->log_level, table);
  AddLogFormat(&config->log_format, table);
}

void AddOptions(SpoolConfig* config, OptionTable* table) {
  using Kind = SpoolConfig::Kind;
  using Full = SpoolConfig::Full;
  table->AddChoice(
      "kind", &config->kind,
      std::vector<std::pair<std::string, Kind>>{{"disk", Kind::kDisk}, {"memory", Kind::kMemory}},
      "where observations wait for the server");
  table->Add("limit_mb", &config->limit_mb, {1, 1 << 20, "MiB"},
             "of observations that are not acknowledged");
  table->AddChoice("full", &config->full,
                   std::vector<std::pair<std::string, Full>>{{"block", Full::kBlock},
                                                             {"drop_oldest", Full::kDropOldest}},
                   "what happens when the spool is full");
  table->Add("sync_interval_ms", &config->sync_interval_ms, {0, 60'000, "ms"},
             "between syncs to the disk; 0: every observation");
  using DurableOn = SpoolConfig::DurableOn;
  table->AddChoice("durable_on", &config->durable_on,
                   std::vector<std::pair<std::string, DurableOn>>{{"server", DurableOn::kServer},
                                                                  {"standby", DurableOn::kStandby}},
                   "who must have observations before they are forgotten here");
}

void AddOptions(PreviewConfig* config, OptionTable* table) {
  table->Add("enabled", &config->enabled, "whether frames may leave this PC");
  table->Add("max_rate_hz", &config->max_rate_hz, {kAboveZero, 10, "Hz"}, "of each camera");
  table->Add("max_kb", &config->max_kb, {8, 1024, "KiB"}, "of one JPEG");
}

absl::Status AgentConfig::Validate() const {
  FaultList faults;
  CheckOptions(*this, &faults);
  CheckOptions(preview, &faults);
  CheckOptions(spool, &faults);
  return faults.Result("", "\n");
}

absl::StatusOr<AgentConfig> ReadAgentConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  AgentConfig config;
  OptionTable options, preview, spool;
  AddOptions(&config, &options);
  AddOptions(&config.spool, &spool);
  AddOptions(&config.preview, &preview);
  TomlSection section(&file, file.root);
  section.Take(options);
  config.state_dir = ResolvedPath(path, config.state_dir);
  ReadTable(&file, &section, "preview", preview);
  ReadTable(&file, &section, "spool", spool);
  std::set<std::string> names;
  for (const toml::table* table : section.TakeTables("camera")) {
    config.cameras.push_back(ReadCamera(&file, *table));
    const std::string& name = config.cameras.back().name;
    if (!name.empty() && !names.insert(name).second) {
      file.AddFault(*table, absl::StrCat("camera ", name, " is there twice"));
    }
  }
  section.RefuseOtherKeys();
  RIGCAL_RETURN_IF_ERROR(file.Result());
  return config;
}

}  // namespace rigcal
