// SPDX-License-Identifier: Apache-2.0
#include "common/config/event_camera_config.h"

#include <algorithm>
#include <array>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/config/toml_section.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

constexpr std::array kInputs = {"main", "aux", "loopback"};

void ReadTriggerInputs(TomlFile* file, TomlSection& section, EventCameraConfig* config) {
  const toml::node* node = section.TakeNode("trigger_in");
  if (node == nullptr) return;
  const toml::array* list = node->as_array();
  if (list == nullptr) return section.AddFault("trigger_in", "must be a list, such as [\"main\"]");
  std::vector<std::string>& inputs = config->trigger_in;
  for (const toml::node& entry : *list) {
    const std::string input = entry.value<std::string>().value_or("");
    if (std::ranges::find(kInputs, input) == kInputs.end()) {
      file->AddFault(entry, absl::StrCat("trigger_in must hold ", absl::StrJoin(kInputs, ", "),
                                         ", not ", input.empty() ? "this" : input));
    } else if (std::ranges::find(inputs, input) == inputs.end()) {
      inputs.push_back(input);
    }
  }
}

void ReadBiases(TomlFile* file, TomlSection& section, EventCameraConfig* config) {
  const toml::table* table = section.TakeTable("biases");
  if (table == nullptr) return;
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

const std::vector<std::pair<std::string, EventCameraSync>>& EventCameraSyncNames() {
  static const auto* const kNames = new std::vector<std::pair<std::string, EventCameraSync>>{
      {"standalone", EventCameraSync::kStandalone},
      {"primary", EventCameraSync::kPrimary},
      {"secondary", EventCameraSync::kSecondary}};
  return *kNames;
}

std::string EventCameraSyncName(EventCameraSync sync) {
  const auto value_of = [](const auto& choice) { return choice.second; };
  return std::ranges::find(EventCameraSyncNames(), sync, value_of)->first;
}

absl::StatusOr<EventCameraConfig> ReadEventCameraConfig(const std::string& path) {
  RIGCAL_ASSIGN_OR_RETURN(TomlFile file, ReadTomlFile(path));
  EventCameraConfig config;
  OptionTable options;
  options.AddChoice("format", &config.format,
                    std::vector<std::pair<std::string, std::string>>{
                        {"EVT2", "EVT2"}, {"EVT21", "EVT21"}, {"EVT3", "EVT3"}},
                    "of the stream");
  options.AddChoice("sync", &config.sync, EventCameraSyncNames(), "role on a sync cable");
  options.Add("event_rate_limit", &config.event_rate_limit, {0, 4294967295, "events/s"},
              "0: no limit");
  TomlSection section(&file, file.root);
  section.Take(options);
  ReadTriggerInputs(&file, section, &config);
  ReadBiases(&file, section, &config);
  section.RefuseOtherKeys();
  RIGCAL_RETURN_IF_ERROR(file.Result());
  return config;
}

}  // namespace rigcal
