// SPDX-License-Identifier: Apache-2.0
#include "agent/command/event_file_flags.h"

#include <string>

#include "absl/strings/str_cat.h"

namespace rigcal::agent {

EventFileFlags::EventFileFlags() {
  AddGeometry(&geometry, &table_);
  AddOptions(&plain, &table_);
}

void EventFileFlags::AddTo(CLI::App& command) {
  for (const OptionHelp& option : table_.Help()) {
    const std::string flag = "--" + option.name;
    const auto set = [this, flag, name = option.name](const std::string& value) {
      FaultList faults;
      table_.ReadOne({.key = name, .value = value}, &faults);
      const absl::Status status = faults.Result();
      if (!status.ok()) throw CLI::ValidationError(flag, std::string(status.message()));
    };
    const std::string standard =
        option.default_value.empty() ? "" : absl::StrCat(" [", option.default_value, "]");
    command.add_option_function<std::string>(flag, set, option.meaning + standard)
        ->type_name(option.values);
  }
}

}  // namespace rigcal::agent
