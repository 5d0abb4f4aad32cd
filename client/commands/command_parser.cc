// SPDX-License-Identifier: Apache-2.0
#include "client/commands/command_parser.h"

#include <cstdlib>
#include <map>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/command_line/command_line.h"
#include "common/wire/protocol_version.h"
#include "common/wire/server_access.h"
#include "common/wire/server_list.h"

namespace rigcal::client {
namespace {

// Together they fit a terminal of 80 columns.
constexpr size_t kNameColumns = 28;
constexpr size_t kTextColumns = 52;

constexpr char kDescription[] =
    "rigcal: calibrates rigs of many cameras that watch a waved wand\n"
    "\n"
    "From a recording, on one machine:\n"
    "  rigcal local --data DIR --target wand:0,0.13,0.39\n"
    "With a server and agents beside the cameras:\n"
    "  rigcal session create --target wand:0,0.13,0.39 --id wave --start\n"
    "  rigcal session stop wave --wait\n"
    "  rigcal calibrate wave --wait\n"
    "  rigcal calibration export ID --format opencv --output DIR\n"
    "Has a camera moved since? After ten seconds of waving:\n"
    "  rigcal monitor RIG --session check\n"
    "  rigcal calibrate check --only CAMERA --activate\n"
    "Something wrong:\n"
    "  rigcal doctor\n";

std::string DefaultServer() {
  const char* given = std::getenv("RIGCAL_SERVER");
  if (given != nullptr && *given != '\0') return given;
  return wire::DefaultServerAddress(wire::ClientIdentity::OfUser());
}

// Breaks lines between words.
std::string Wrap(const std::string& text, size_t columns = kTextColumns) {
  std::string result;
  size_t column = 0;
  for (const absl::string_view word : absl::StrSplit(text, ' ')) {
    const bool breaks = column + 1 + word.size() > columns;
    if (column > 0) result += breaks ? '\n' : ' ';
    column = (column == 0 || breaks ? 0 : column + 1) + word.size();
    absl::StrAppend(&result, word);
  }
  return result;
}

// CLI11's own does not break long lines.
class WrappingFormatter : public CLI::Formatter {
 public:
  WrappingFormatter() {
    column_width(kNameColumns);
    label("REQUIRED", "(required)");
  }
  std::string make_option_desc(const CLI::Option* option) const override {
    return Wrap(CLI::Formatter::make_option_desc(option));
  }
  std::string make_description(const CLI::App* app) const override {
    const std::string& text = app->get_description();
    // The program's own has its lines already.
    const bool has_lines = text.find('\n') != std::string::npos;
    return (has_lines ? text : Wrap(text, kNameColumns + kTextColumns)) + "\n";
  }
  std::string make_subcommand(const CLI::App* app) const override {
    std::stringstream out;
    std::string names = app->get_name();
    for (const std::string& alias : app->get_aliases()) absl::StrAppend(&names, ",", alias);
    CLI::detail::format_help(out, names, Wrap(app->get_description()), kNameColumns);
    return out.str();
  }
};

}  // namespace

CommandParser::CommandParser(Console& console)
    : app_(kDescription, "rigcal"), console_(console), server_(DefaultServer()) {
  // Inherited by every command, as is the footer.
  app_.require_subcommand(1);
  app_.footer(std::string(kExitCodeHelp));
  app_.formatter(std::make_shared<WrappingFormatter>());
  AddServerOption(&app_);
  AddFormatOption(&app_);
}

void CommandParser::AddServerOption(CLI::App* app) {
  app->add_option(
         "--server", server_,
         absl::StrCat("Address of rigcal-server, or several with commas between, of which ",
                      "the one that answers is asked; without it RIGCAL_SERVER, the server ",
                      "you have joined, one of your own on this PC, or ",
                      std::string(kDefaultServer)))
      ->type_name("HOST:PORT,...");
}

void CommandParser::AddFormatOption(CLI::App* app) {
  static const std::map<std::string, OutputFormat> formats = {{"table", OutputFormat::kTable},
                                                              {"json", OutputFormat::kJson}};
  app->add_option_function<std::string>(
         "-o,--output-format",
         [this](const std::string& name) { console_.format = formats.at(name); },
         "Output on stdout: a table for people, JSON for programs")
      ->type_name("table|json")
      ->check(CLI::IsMember({"table", "json"}).description(""));
}

CLI::App* CommandParser::AddGroup(const std::string& name, const std::string& description) {
  CLI::App* group = app_.add_subcommand(name, description);
  group->require_subcommand(1);
  return group;
}

CLI::App* CommandParser::AddCommand(CLI::App* parent, const std::string& name,
                                    const std::string& description, Command command,
                                    bool asks_server) {
  CLI::App* app = (parent == nullptr ? &app_ : parent)->add_subcommand(name, description);
  app->callback([this, app, command = std::move(command), asks_server] {
    if (!app->get_subcommands().empty()) return;
    chosen_ = command;
    asks_server_ = asks_server;
  });
  AddFormatOption(app);
  if (asks_server) AddServerOption(app);
  return app;
}

ExitCode CommandParser::Run(const std::vector<std::string>& arguments) {
  AddVersionFlags(app_, std::string(wire::kSoftwareVersion));
  const absl::StatusOr<CommandLineTask> task = ParseCommandLine(app_, arguments, console_.out);
  const absl::Status address = wire::ServerList::Parse(server_).status();
  if (!task.ok()) {
    console_.Message(std::string(task.status().message()));
    return ExitCode::kUsage;
  }
  if (*task == CommandLineTask::kDone) return ExitCode::kOk;
  if (asks_server_ && !address.ok()) {
    console_.Message(absl::StrCat(std::string(address.message()), "; see rigcal --help"));
    return ExitCode::kUsage;
  }
  CommandContext context{console_, server_};
  return chosen_(context);
}

}  // namespace rigcal::client
