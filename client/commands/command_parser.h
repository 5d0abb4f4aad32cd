// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "client/commands/command_context.h"
#include "client/net/paging.h"
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
  // the top. It runs only when the whole command line is right, and none of its own subcommands was
  // typed.
  CLI::App* AddCommand(CLI::App* parent, const std::string& name, const std::string& description,
                       Command command, bool asks_server = true);
  // One that runs with options, which the arguments added to it are to set. They live as long as
  // the command.
  template <typename Options>
  std::pair<CLI::App*, Options*> AddCommand(CLI::App* parent, const std::string& name,
                                            const std::string& description,
                                            ExitCode (*run)(const Options&, CommandContext&),
                                            bool asks_server = true) {
    const auto options = std::make_shared<Options>();
    const auto command = [options, run](CommandContext& context) { return run(*options, context); };
    return {AddCommand(parent, name, description, Command(command), asks_server), options.get()};
  }

 private:
  void AddServerOption(CLI::App* app);
  void AddFormatOption(CLI::App* app);

  CLI::App app_;
  Console& console_;
  std::string server_;
  Command chosen_;
  bool asks_server_ = true;
};

// Each file of commands adds its own.
void AddBoardCommands(CommandParser& parser);
void AddLensCommands(CommandParser& parser);
void AddSessionCommands(CommandParser& parser);
void AddCameraCommands(CommandParser& parser);
void AddCalibrationCommands(CommandParser& parser);
void AddTriangulateCommand(CommandParser& parser);
void AddIdentityCommands(CommandParser& parser);
void AddRigCommands(CommandParser& parser);
void AddServerCommands(CommandParser& parser);
void AddWorkerCommands(CommandParser& parser);
void AddLocalCommand(CommandParser& parser);

// Options that several commands share. What cannot be read is a usage error naming the option.
void AddTargetOption(CLI::App* app, bool required, Target* target);
template <typename Value>
void AddArgument(CLI::App* app, const char* name, const char* what, Value* value) {
  app->add_option(name, *value, what)->type_name("")->required();
}
// An option of one word behind it.
template <typename Value>
CLI::Option* AddOption(CLI::App* app, const char* name, const std::string& type, Value* value,
                       const std::string& what) {
  return app->add_option(name, *value, what)->type_name(type);
}
// The same, read by `parse`, which returns a StatusOr.
template <typename Value, typename Parse>
CLI::Option* AddParsedOption(CLI::App* app, const std::string& name, const char* type, Value* value,
                             Parse parse, const std::string& what) {
  const auto read = [=](const std::string& text) {
    auto parsed = parse(text);
    if (!parsed.ok()) {
      throw CLI::ValidationError(name + " " + text, std::string(parsed.status().message()));
    }
    *value = *std::move(parsed);
  };
  return app->add_option_function<std::string>(name, read, what)->type_name(type);
}
// --force of a command that writes files, --yes of one that deletes.
void AddForceOption(CLI::App* app, bool* force);
void AddYesOption(CLI::App* app, bool* yes);
// --rig, --filter and --order-by of a list command. `example` is a term for --filter, `orders`
// names the fields for --order-by.
void AddListOptions(CLI::App* app, const std::string& example, const std::string& orders,
                    ListOptions* options);
void AddCalibrationOptions(CLI::App* app, CalibrationOptions* options);
// A finite number from `low` to `high`.
CLI::Validator NumberBetween(double low, double high);

}  // namespace rigcal::client
