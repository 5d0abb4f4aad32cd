// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "client/commands/command_context.h"
#include "client/commands/list_options.h"
#include "common/calibration/calibration_options.h"
#include "common/target/target.h"

namespace rigcal::client {

// How commands declare what a user can type; included only by the files that do so.
class CommandParser {
 public:
  using Command = std::function<ExitCode(CommandContext&)>;

  explicit CommandParser(Console& console);

  // Reads the arguments behind the program's name and runs the command they name.
  ExitCode Run(const std::vector<std::string>& arguments);

  // A word that needs one of its subcommands behind it.
  CLI::App* AddGroup(const std::string& name, const std::string& description);
  // A word that does something, with -o and, where it asks a server, --server. `parent` null: at
  // the top. It runs only when the whole command line is right.
  CLI::App* AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                       Command command);
  CLI::App* AddServerlessCommand(const std::string& name, const std::string& description,
                                 Command command);

 private:
  void AddServerOption(CLI::App* app);
  void AddFormatOption(CLI::App* app);
  void Choose(const Command& command, bool asks_server);
  ExitCode Usage(const std::string& message);

  CLI::App app_;
  Console& console_;
  std::string server_;
  Command chosen_;
  bool asks_server_ = true;
};

// Each file of commands adds its own.
void AddSessionCommands(CommandParser& parser);
void AddCalibrationCommands(CommandParser& parser);
void AddLocalCommand(CommandParser& parser);

// Options that several commands share. What cannot be read is a usage error naming the option.
void AddTargetOption(CLI::App* app, bool required, Target* target);
// --rig, --filter and --order-by of a list command. `example` is a term for --filter, `orders`
// names the fields for --order-by.
void AddListOptions(CLI::App* app, const std::string& example, const std::string& orders,
                    ListOptions* options);
void AddCalibrationOptions(CLI::App* app, CalibrationOptions* options);
// A finite number from `low` to `high`.
CLI::Validator NumberBetween(double low, double high);

}  // namespace rigcal::client
