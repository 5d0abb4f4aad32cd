// SPDX-License-Identifier: Apache-2.0
#include "common/config/event_camera_config.h"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr std::array kFormats = {"EVT2", "EVT21", "EVT3"};
constexpr std::array kInputs = {"main", "aux", "loopback"};
constexpr std::array<std::pair<const char*, EventCameraSync>, 3> kSyncs = {
    {{"standalone", EventCameraSync::kStandalone},
     {"primary", EventCameraSync::kPrimary},
     {"secondary", EventCameraSync::kSecondary}}};

template <typename List>
bool Contains(const List& list, const std::string& text) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

void ReadFormat(TomlSection& section, EventCameraConfig* config) {
  if (!section.Take("format", &config->format) || Contains(kFormats, config->format)) return;
  section.AddFault("format", absl::StrCat("\"", config->format,
                                          "\" is not known: ", absl::StrJoin(kFormats, ", ")));
}

void ReadSync(TomlSection& section, EventCameraConfig* config) {
  std::string text;
  if (!section.Take("sync", &text)) return;
  const absl::StatusOr<EventCameraSync> sync = ParseEventCameraSync(text);
  if (sync.ok()) {
    config->sync = *sync;
  } else {
    section.AddFault("sync", std::string(sync.status().message()));
  }
}

void ReadTriggerInputs(TomlFile* file, TomlSection& section, EventCameraConfig* config) {
  const toml::node* node = section.TakeNode("trigger_in");
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr) {
    section.AddFault("trigger_in", "must be a list, such as [\"main\"]");
    return;
  }
  for (const toml::node& entry : *list) {
    const std::string input = entry.value<std::string>().value_or("");
    if (!Contains(kInputs, input)) {
      file->AddFault(entry,
                     absl::StrCat("trigger_in holds ",
                                  input.empty() ? "something" : absl::StrCat("\"", input, "\""),
                                  " that is none of ", absl::StrJoin(kInputs, ", ")));
    } else if (!Contains(config->trigger_in, input)) {
      config->trigger_in.push_back(input);
    }
  }
}

void ReadEventRateLimit(TomlSection& section, EventCameraConfig* config) {
  int64_t limit = 0;
  if (!section.Take("event_rate_limit", &limit)) return;
  if (limit < 0 || limit > std::numeric_limits<uint32_t>::max()) {
    section.AddFault("event_rate_limit", "must be 0 (no limit) to 4294967295 events a second");
    return;
  }
  config->event_rate_limit = limit;
}

void ReadBiases(TomlFile* file, TomlSection& section, EventCameraConfig* config) {
  const toml::node* node = section.TakeNode("biases");
  if (node == nullptr) return;
  const toml::table* table = node->as_table();
  if (table == nullptr) {
    section.AddFault("biases", "must be written as [biases]");
    return;
  }
  for (const auto& [name, value] : *table) {
    const toml::value<int64_t>* number = value.as_integer();
    if (number == nullptr || number->get() < std::numeric_limits<int>::min() ||
        number->get() > std::numeric_limits<int>::max()) {
      file->AddFault(value, absl::StrCat(std::string(name.str()), " must be a whole number"));
      continue;
    }
    config->biases[std::string(name.str())] = static_cast<int>(number->get());
  }
}

}  // namespace

absl::StatusOr<EventCameraSync> ParseEventCameraSync(std::string_view text) {
  for (const auto& [name, sync] : kSyncs) {
    if (text == name) return sync;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("\"", std::string(text), "\" is none of standalone, primary and secondary"));
}

std::string EventCameraSyncName(EventCameraSync sync) {
  for (const auto& [name, value] : kSyncs) {
    if (value == sync) return name;
  }
  return "unknown";
}

absl::StatusOr<EventCameraConfig> ReadEventCameraConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  EventCameraConfig config;
  TomlSection section(&file, file.root);
  ReadFormat(section, &config);
  ReadSync(section, &config);
  ReadTriggerInputs(&file, section, &config);
  ReadEventRateLimit(section, &config);
  ReadBiases(&file, section, &config);
  section.RefuseOtherKeys();
  RIGCAL_RETURN_IF_ERROR(file.Result());
  return config;
}

}  // namespace rigcal
