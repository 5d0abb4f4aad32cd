// SPDX-License-Identifier: Apache-2.0
#include "client/commands/command_parser.h"

#include <cstdlib>
#include <map>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/utf8.h"
#include "common/wire/protocol_version.h"
#include "common/wire/server_access.h"

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
    CLI::detail::format_help(out, app->get_name(), Wrap(app->get_description()), kNameColumns);
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
  app_.set_version_flag("--version", absl::StrCat("rigcal ", std::string(wire::kSoftwareVersion)));
  AddServerOption(&app_);
  AddFormatOption(&app_);
}

void CommandParser::AddServerOption(CLI::App* app) {
  app->add_option("--server", server_,
                  absl::StrCat("Address of rigcal-server; without it RIGCAL_SERVER, the server ",
                               "you have joined, one of your own on this PC, or ",
                               std::string(kDefaultServer)))
      ->type_name("HOST:PORT");
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
  app->callback([this, command = std::move(command), asks_server] {
    chosen_ = command;
    asks_server_ = asks_server;
  });
  AddFormatOption(app);
  if (asks_server) AddServerOption(app);
  return app;
}

ExitCode CommandParser::Usage(const std::string& message) {
  console_.Message(absl::StrCat(message, "; --help shows how it is used"));
  return ExitCode::kUsage;
}

ExitCode CommandParser::Run(const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (!IsUtf8(argument)) return Usage(absl::StrCat("'", argument, "' is not UTF-8"));
  }
  try {
    // CLI11 takes them from the back.
    app_.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::Success& help) {
    app_.exit(help, console_.out, console_.err);
    return ExitCode::kOk;
  } catch (const CLI::RequiredError& error) {
    // It complains of the missing before the unknown, which is mostly why it is missing.
    const std::vector<std::string> unknown = app_.remaining(/*recurse=*/true);
    return Usage(unknown.empty() ? error.what() : absl::StrCat("'", unknown[0], "' is not known"));
  } catch (const CLI::ParseError& error) {
    return Usage(error.what());
  }
  if (const absl::Status status = ValidateServerAddress(server_); asks_server_ && !status.ok()) {
    return Usage(std::string(status.message()));
  }
  CommandContext context{console_, server_};
  return chosen_(context);
}

}  // namespace rigcal::client
