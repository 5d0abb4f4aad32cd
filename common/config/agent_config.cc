// SPDX-License-Identifier: Apache-2.0
#include "common/config/agent_config.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/camera/camera_id.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal {
namespace {

constexpr std::array kLogLevels = {"trace", "debug", "info", "warn", "error", "off"};
constexpr int64_t kMaxSpoolMb = 1 << 20;
constexpr double kMaxPreviewRateHz = 10;
constexpr int64_t kMinPreviewKb = 8;
constexpr int64_t kMaxPreviewKb = 1024;

// Empty: right. Else what is wrong with the value, behind its key.
using Fault = std::string;

Fault NameFault(std::string_view what, const std::string& name) {
  const absl::Status status = ValidateName(what, name);
  return status.ok() ? "" : absl::StrCat("is refused: ", std::string(status.message()));
}

Fault ServerFault(const std::string& server) {
  const size_t colon = server.rfind(':');
  int port = 0;
  const bool is_address = colon != std::string::npos && colon > 0 &&
                          absl::SimpleAtoi(server.substr(colon + 1), &port) && port > 0 &&
                          port < 65536;
  return is_address ? "" : absl::StrCat("\"", server, "\" is not HOST:PORT, as 127.0.0.1:7420 is");
}

Fault LogLevelFault(const std::string& level) {
  if (std::find(kLogLevels.begin(), kLogLevels.end(), level) != kLogLevels.end()) return "";
  return absl::StrCat("\"", level, "\" is not one of ", absl::StrJoin(kLogLevels, ", "));
}

Fault SpoolFault(int64_t limit_mb) {
  if (limit_mb >= 1 && limit_mb <= kMaxSpoolMb) return "";
  return absl::StrCat(limit_mb, " is not within 1 to ", kMaxSpoolMb);
}

Fault PreviewRateFault(double rate_hz) {
  if (rate_hz > 0 && rate_hz <= kMaxPreviewRateHz) return "";
  return absl::StrCat(rate_hz, " is not above 0 and at most ", kMaxPreviewRateHz);
}

Fault PreviewSizeFault(int64_t max_kb) {
  if (max_kb >= kMinPreviewKb && max_kb <= kMaxPreviewKb) return "";
  return absl::StrCat(max_kb, " is not within ", kMinPreviewKb, " to ", kMaxPreviewKb);
}

void NoteFault(TomlSection& section, std::string_view key, const Fault& fault) {
  if (!fault.empty()) section.AddFault(key, fault);
}

// Relative to the folder of the configuration file.
std::string Resolved(const std::string& folder, const std::string& path) {
  return path.empty() ? path : (std::filesystem::path(folder) / path).lexically_normal().string();
}

const SourceKindName* FindSourceKind(const std::string& source) {
  const auto* const found =
      std::find_if(kSourceKindNames.begin(), kSourceKindNames.end(),
                   [&](const SourceKindName& kind) { return source.starts_with(kind.prefix); });
  return found == kSourceKindNames.end() ? nullptr : found;
}

std::string ResolvedSource(const std::string& folder, const std::string& source) {
  const SourceKindName* kind = FindSourceKind(source);
  if (kind == nullptr || !kind->is_path) return source;
  const std::string body = source.substr(kind->prefix.size());
  const size_t end = std::min(body.find(';'), body.size());
  return absl::StrCat(std::string(kind->prefix), Resolved(folder, body.substr(0, end)),
                      body.substr(end));
}

// Empty: a table or an array, which no option is.
std::string OptionText(const toml::node& node) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* flag = node.as_boolean()) return flag->get() ? "1" : "0";
  if (const auto* whole = node.as_integer()) return absl::StrCat(whole->get());
  if (const auto* number = node.as_floating_point()) return ShortestText(number->get());
  return "";
}

// A table whose keys the source knows.
void ReadOptions(TomlFile* file, TomlSection& section, std::string_view key,
                 const std::string& folder, CameraConfig* camera) {
  const toml::node* node = section.TakeNode(key);
  if (node == nullptr) return;
  const toml::table* table = node->as_table();
  if (table == nullptr) {
    section.AddFault(key, absl::StrCat("must be written as [camera.", std::string(key), "]"));
    return;
  }
  for (const auto& [name, value] : *table) {
    SourceOption option{.key = std::string(name.str()),
                        .value = OptionText(value),
                        .where = absl::StrCat(file->path, ":", value.source().begin.line)};
    if (option.value.empty()) {
      file->AddFault(value, absl::StrCat(option.key, " must be a number, true, false or a text"));
      continue;
    }
    constexpr std::array kPaths = {"biases", "mask", "timestamps"};
    if (std::find(kPaths.begin(), kPaths.end(), option.key) != kPaths.end()) {
      option.value = Resolved(folder, option.value);
    }
    camera->options.push_back(std::move(option));
  }
}

CameraConfig ReadCamera(TomlFile* file, const toml::table& table, const std::string& folder) {
  TomlSection section(file, table);
  CameraConfig camera;
  camera.where = absl::StrCat(file->path, ":", table.source().begin.line);
  if (section.Take("name", &camera.name)) {
    NoteFault(section, "name", NameFault("camera name", camera.name));
  }
  if (section.Take("source", &camera.source)) {
    if (FindSourceKind(camera.source) == nullptr) {
      section.AddFault("source", absl::StrCat("\"", camera.source, "\" begins with none of ",
                                              ListOfSourceKinds()));
    }
    camera.source = ResolvedSource(folder, camera.source);
  } else if (!table.contains("source")) {
    file->AddFault(table, "a camera without source; example: source = \"csv:left.csv\"");
  }
  section.Take("calibration", &camera.calibration);
  if (camera.calibration != "none") camera.calibration = Resolved(folder, camera.calibration);
  if (double sigma_px = 0; section.Take("sigma", &sigma_px)) {
    if (!(sigma_px > 0)) section.AddFault("sigma", "must be above 0 pixels");
    camera.sigma_px = sigma_px;
  }
  const toml::node* speed = section.TakeNode("speed");
  if (speed != nullptr && speed->value<std::string>() == "max") {
    camera.speed = std::numeric_limits<double>::infinity();
  } else if (speed != nullptr) {
    camera.speed = speed->is_number() ? speed->value<double>() : std::nullopt;
    if (!camera.speed || !(*camera.speed > 0 && *camera.speed <= 1e6)) {
      section.AddFault("speed", "must be \"max\" or a factor above 0");
    }
  }
  ReadOptions(file, section, "settings", folder, &camera);
  ReadOptions(file, section, "detector", folder, &camera);
  section.RefuseOtherKeys();
  return camera;
}

void ReadPreview(TomlFile* file, TomlSection& section, PreviewConfig* preview) {
  const toml::node* node = section.TakeNode("preview");
  if (node == nullptr) return;
  const toml::table* table = node->as_table();
  if (table == nullptr) {
    section.AddFault("preview", "must be a table: [preview], and enabled = true below it");
    return;
  }
  TomlSection own(file, *table);
  own.Take("enabled", &preview->enabled);
  if (own.Take("max_rate_hz", &preview->max_rate_hz)) {
    NoteFault(own, "max_rate_hz", PreviewRateFault(preview->max_rate_hz));
  }
  if (own.Take("max_kb", &preview->max_kb)) {
    NoteFault(own, "max_kb", PreviewSizeFault(preview->max_kb));
  }
  own.RefuseOtherKeys();
}

void ReadCameras(TomlFile* file, TomlSection& section, const std::string& folder,
                 AgentConfig* config) {
  const toml::node* node = section.TakeNode("camera");
  if (node == nullptr) return;
  const toml::array* array = node->as_array();
  if (array == nullptr || !array->is_homogeneous<toml::table>()) {
    section.AddFault("camera", "must be written as [[camera]]");
    return;
  }
  std::set<std::string> names;
  for (const toml::node& entry : *array) {
    CameraConfig camera = ReadCamera(file, *entry.as_table(), folder);
    if (!camera.name.empty() && !names.insert(camera.name).second) {
      file->AddFault(entry, absl::StrCat("camera ", camera.name, " is there twice"));
    }
    config->cameras.push_back(std::move(camera));
  }
}

}  // namespace

std::string ListOfSourceKinds() {
  return absl::StrJoin(kSourceKindNames, ", ", [](std::string* out, const SourceKindName& kind) {
    absl::StrAppend(out, std::string(kind.prefix));
  });
}

absl::Status AgentConfig::Validate() const {
  std::vector<std::string> faults;
  const auto note = [&faults](std::string_view what, const Fault& fault) {
    if (!fault.empty()) faults.push_back(absl::StrCat(std::string(what), " ", fault));
  };
  note("server", ServerFault(server));
  note("rig", NameFault("rig", rig));
  if (!agent_id.empty()) note("agent_id", NameFault("agent_id", agent_id));
  note("log_level", LogLevelFault(log_level));
  note("spool_limit_mb", SpoolFault(static_cast<int64_t>(spool_limit_mb)));
  note("preview.max_rate_hz", PreviewRateFault(preview.max_rate_hz));
  note("preview.max_kb", PreviewSizeFault(preview.max_kb));
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrJoin(faults, "\n"));
}

absl::StatusOr<AgentConfig> ReadAgentConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  const toml::table root = std::exchange(file.root, {});
  AgentConfig config;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  TomlSection section(&file, root);
  if (section.Take("server", &config.server)) {
    NoteFault(section, "server", ServerFault(config.server));
  }
  if (section.Take("rig", &config.rig)) NoteFault(section, "rig", NameFault("rig", config.rig));
  if (section.Take("agent_id", &config.agent_id)) {
    NoteFault(section, "agent_id", NameFault("agent_id", config.agent_id));
  }
  section.Take("state_dir", &config.state_dir);
  config.state_dir = Resolved(folder, config.state_dir);
  if (section.Take("log_level", &config.log_level)) {
    NoteFault(section, "log_level", LogLevelFault(config.log_level));
  }
  if (int64_t limit_mb = 0; section.Take("spool_limit_mb", &limit_mb)) {
    NoteFault(section, "spool_limit_mb", SpoolFault(limit_mb));
    config.spool_limit_mb = static_cast<size_t>(limit_mb);
  }
  ReadPreview(&file, section, &config.preview);
  ReadCameras(&file, section, folder, &config);
  section.RefuseOtherKeys();
  RIGCAL_RETURN_IF_ERROR(file.Result());
  return config;
}

}  // namespace rigcal
