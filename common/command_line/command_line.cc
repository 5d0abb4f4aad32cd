// SPDX-License-Identifier: Apache-2.0
#include "common/command_line/command_line.h"

#include <algorithm>
#include <functional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/options/nearest_name.h"
#include "common/text/utf8.h"

namespace rigcal {
namespace {

// "rigcal session list".
std::string FullName(const CLI::App& app) {
  const CLI::App* const parent = app.get_parent();
  return parent == nullptr ? app.get_name() : absl::StrCat(FullName(*parent), " ", app.get_name());
}

// The program, and the commands that were typed, the last one at the end.
std::vector<const CLI::App*> TypedCommands(const CLI::App& app) {
  std::vector<const CLI::App*> typed = {&app};
  while (!typed.back()->get_subcommands().empty()) {
    typed.push_back(typed.back()->get_subcommands().front());
  }
  return typed;
}

std::vector<const CLI::App*> CommandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

std::vector<std::string> CommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* const command : CommandsOf(app)) names.push_back(command->get_name());
  return names;
}

// "--target" and so on; those of before have no group.
std::vector<std::string> OptionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* const option :
       app.get_options([](const CLI::Option* each) { return !each->get_group().empty(); })) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// Commands called `name` anywhere in the program, in full.
void FindCommands(const CLI::App& app, const std::string& name, std::vector<std::string>* found) {
  for (const CLI::App* const command : CommandsOf(app)) {
    if (command->get_name() == name) found->push_back(FullName(*command));
    FindCommands(*command, name, found);
  }
}

const CLI::App& ProgramOf(const CLI::App& app) {
  const CLI::App* program = &app;
  while (program->get_parent() != nullptr) program = program->get_parent();
  return *program;
}

// What other programs call it.
std::string SynonymOf(const std::string& word, const std::vector<std::string>& known) {
  constexpr std::pair<const char*, const char*> kSynonyms[] = {
      {"show", "get"},        {"view", "get"},    {"info", "get"},     {"describe", "get"},
      {"print", "get"},       {"ls", "list"},     {"all", "list"},     {"rm", "delete"},
      {"remove", "delete"},   {"del", "delete"},  {"new", "create"},   {"add", "create"},
      {"begin", "start"},     {"run", "start"},   {"end", "stop"},     {"finish", "stop"},
      {"continue", "resume"}, {"save", "export"}, {"write", "export"}, {"read", "import"},
      {"load", "import"}};
  for (const auto& [other, ours] : kSynonyms) {
    if (word == other && std::ranges::find(known, ours) != known.end()) return ours;
  }
  return "";
}

// The only option that begins so: "--accept" of --accept-mm.
std::string BegunOption(const std::string& name, const std::vector<std::string>& known) {
  std::string found;
  for (const std::string& option : known) {
    if (name.size() < 5 || !option.starts_with(name) || option == found) continue;
    if (!found.empty()) return "";
    found = option;
  }
  return found;
}

std::string UnknownOption(const std::vector<const CLI::App*>& typed, const std::string& text) {
  const std::string name = text.substr(0, text.find('='));
  std::vector<std::string> known = OptionNames(*typed.back());
  // Options of the program stand in front of a command.
  for (const CLI::App* const app : typed) {
    const std::vector<std::string> more = OptionNames(*app);
    if (std::ranges::find(more, name) != more.end()) {
      return absl::StrCat(
          name, " is an option of ", FullName(*app),
          app == typed.back() ? "" : ": write it in front of the command, or leave it out");
    }
    known.insert(known.end(), more.begin(), more.end());
  }
  const std::string begun = BegunOption(name, known);
  const std::string nearest = begun.empty() ? NearestName(name, known) : begun;
  return absl::StrCat(FullName(*typed.back()), " has no option '", Shown(name), "'",
                      nearest.empty() ? "" : absl::StrCat("; did you mean ", nearest, "?"));
}

std::string UnknownCommand(const CLI::App& app, const std::string& word) {
  const std::vector<std::string> known = CommandNames(app);
  const std::string begin =
      absl::StrCat("'", Shown(word), "' is not known: ", FullName(app), " has no such command; ");
  const std::string synonym = SynonymOf(word, known);
  const std::string nearest = synonym.empty() ? NearestName(word, known) : synonym;
  if (!nearest.empty()) {
    return absl::StrCat(begin, "did you mean '", FullName(app), " ", nearest, "'?");
  }
  std::vector<std::string> elsewhere;
  FindCommands(ProgramOf(app), word, &elsewhere);
  if (!elsewhere.empty()) {
    return absl::StrCat(begin, "did you mean '", absl::StrJoin(elsewhere, "' or '"), "'?");
  }
  return absl::StrCat(begin, "it has ", absl::StrJoin(known, ", "));
}

// A single dash in front of a long name is read as a short option with a value.
std::string SingleDash(const std::vector<const CLI::App*>& typed,
                       const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument.size() < 4 || argument[0] != '-' || argument[1] == '-') continue;
    const std::string name = "-" + argument.substr(0, argument.find('='));
    for (const CLI::App* const app : typed) {
      const std::vector<std::string> known = OptionNames(*app);
      if (std::ranges::find(known, name) == known.end()) continue;
      return absl::StrCat("'", Shown(argument), "' has one dash; it is ", name);
    }
  }
  return "";
}

// The first word that no command takes. Empty: there is none.
std::string Unknown(const std::vector<const CLI::App*>& typed) {
  for (const CLI::App* const app : typed) {
    const std::vector<std::string> words = app->remaining();
    if (words.empty()) continue;
    const std::string& word = words.front();
    if (word.size() > 1 && word.front() == '-') return UnknownOption(typed, word);
    if (!CommandsOf(*app).empty()) return UnknownCommand(*app, word);
    const bool takes_data =
        app->get_option_no_throw("--data") != nullptr && app->count("--data") == 0;
    return absl::StrCat("'", Shown(word), "' is one argument too many for ", FullName(*app),
                        takes_data ? absl::StrCat("; did you mean --data ", Shown(word), "?") : "");
  }
  return "";
}

std::string Complaint(const CLI::App& app, const std::vector<std::string>& arguments,
                      const CLI::ParseError& error) {
  const std::vector<const CLI::App*> typed = TypedCommands(app);
  const std::string dash = SingleDash(typed, arguments);
  if (!dash.empty()) return dash;
  // What is unknown is mostly why something else is missing.
  const std::string unknown = Unknown(typed);
  if (!unknown.empty()) return unknown;
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    const CLI::App& last = *typed.back();
    if (last.get_require_subcommand_min() > 0 && last.get_subcommands().empty()) {
      return absl::StrCat(FullName(last), " needs a command (a subcommand) behind it: ",
                          absl::StrJoin(CommandNames(last), ", "));
    }
  }
  return error.what();
}

}  // namespace

void AddVersionFlags(CLI::App& app, const std::string& version) {
  const std::string text = absl::StrCat(ProgramOf(app).get_name(), " ", version);
  const std::function<void(CLI::App&)> add = [&](CLI::App& each) {
    each.set_version_flag("--version", text);
    for (CLI::App* const command : each.get_subcommands([](CLI::App*) { return true; })) {
      add(*command);
    }
  };
  add(app);
}

void AddFormerOption(CLI::App* app, const std::string& old_name, const std::string& instead) {
  app->add_option_function<std::vector<std::string>>(
         old_name,
         [old_name, instead](const std::vector<std::string>&) {
           throw CLI::ValidationError(absl::StrCat("there is no ", old_name, " any more"),
                                      absl::StrCat("it is ", instead, " now"));
         })
      ->expected(0, 1)
      ->group("");
}

absl::StatusOr<CommandLineTask> ParseCommandLine(CLI::App& app,
                                                 const std::vector<std::string>& arguments,
                                                 std::ostream& out) {
  std::string complaint;
  for (const std::string& argument : arguments) {
    if (!IsUtf8(argument))
      complaint = absl::StrCat("'", absl::CHexEscape(argument.substr(0, 100)), "' is not UTF-8");
  }
  if (complaint.empty()) {
    try {
      // CLI11 takes them from the back.
      app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
      return CommandLineTask::kRun;
    } catch (const CLI::Success& asked) {
      app.exit(asked, out, out);
      out.flush();
      return CommandLineTask::kDone;
    } catch (const CLI::ParseError& error) {
      complaint = Complaint(app, arguments, error);
    }
  }
  return absl::InvalidArgumentError(absl::StrCat(complaint, complaint.ends_with('?') ? " '" : "; '",
                                                 FullName(*TypedCommands(app).back()),
                                                 " --help' shows how it is used"));
}

absl::StatusOr<CommandLineTask> ParseCommandLine(CLI::App& app, int argc, char** argv,
                                                 std::ostream& out) {
  return ParseCommandLine(app, std::vector<std::string>(argv + (argc > 0 ? 1 : 0), argv + argc),
                          out);
}

}  // namespace rigcal
