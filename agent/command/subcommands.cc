// SPDX-License-Identifier: Apache-2.0
#include "agent/command/subcommands.h"

namespace rigcal::agent {

CLI::Option* AddFormatOption(CLI::App& command, std::string* format, const std::string& what) {
  return command.add_option("-o,--output-format", *format, what)
      ->type_name("table|json")
      ->check(CLI::IsMember({"table", "json"}).description(""));
}

CLI::Option* AddOutputOption(CLI::App& command, std::string* path, bool* force,
                             const std::string& what) {
  AddFormerOption(&command, "--out", "--output");
  command.add_flag("--force", *force, "Replace files that exist; without it they stay");
  return command.add_option("--output", *path, what)
      ->type_name("FILE")
      ->check([](const std::string& value) -> std::string {
        if (value != "json" && value != "table") return "";
        // It was the format once.
        return "names a file to write; the format is -o " + value + ", or --output-format " + value;
      });
}

void Subcommands::AddTo(CLI::App& app) {
  app.require_subcommand(0, 1);
  AddJoinCommand(app, this);
  AddCamerasCommand(app, this);
  AddSourcesCommand(app, this);
  AddIntrinsicsCommand(app, this);
  AddDetectCommand(app, this);
  AddTuneCommand(app, this);
  AddMaskCommand(app, this);
  AddInfoCommand(app, this);
  AddConvertCommand(app, this);
  AddSimulateCommand(app, this);
}

}  // namespace rigcal::agent
