// SPDX-License-Identifier: Apache-2.0
// Every option that a message, a help text or a document of commands names is one of our programs'.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "tests/testing/process.h"

namespace rigcal::testing::options_in_messages_test {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;

namespace fs = std::filesystem;

const std::regex& Option() {
  static const std::regex option("(^|[^-A-Za-z0-9])(--[a-z][a-z0-9-]*)");
  return option;
}

std::set<std::string> OptionsIn(const std::string& text) {
  std::set<std::string> options;
  for (std::sregex_iterator found(text.begin(), text.end(), Option()), end; found != end; ++found) {
    options.insert((*found)[2]);
  }
  return options;
}

// Commands in the list "Subcommands:" of a help, by the first of their words.
std::vector<std::string> CommandsIn(const std::string& help) {
  std::vector<std::string> commands;
  bool inside = false;
  for (const auto line : absl::StrSplit(help, '\n')) {
    if (line == "Subcommands:") {
      inside = true;
    } else if (line.empty()) {
      inside = false;
    } else if (inside && line.size() > 3 && line.substr(0, 2) == "  " && line[2] != ' ') {
      commands.emplace_back(line.substr(2, line.find_first_of(" ,", 2) - 2));
    }
  }
  return commands;
}

// Options that a program's command and everything below it have: words at the beginning of the
// lines of its help.
void Collect(std::vector<std::string> command, std::set<std::string>* options) {
  std::vector<std::string> asked = command;
  asked.emplace_back("--help");
  const CommandResult help = RunCommand(asked);
  ASSERT_EQ(help.exit_code, 0) << command.back() << ": " << help.error;
  for (const auto line : absl::StrSplit(help.output, '\n')) {
    const size_t begin = line.find_first_not_of(' ');
    if (begin == line.npos || begin > 4 || line[begin] != '-') continue;
    const auto end = line.find(' ', begin);
    for (const auto word : absl::StrSplit(line.substr(begin, end - begin), ',')) {
      if (absl::string_view(word).substr(0, 2) == "--") options->emplace(word);
    }
  }
  for (const std::string& each : CommandsIn(help.output)) {
    std::vector<std::string> below = command;
    below.push_back(each);
    Collect(below, options);
  }
}

// The string literals of a source, without its comments.
std::string Literals(const std::string& source) {
  std::string text;
  for (size_t i = 0; i < source.size(); ++i) {
    if (source[i] == '/' && i + 1 < source.size() && source[i + 1] == '/') {
      i = std::min(source.find('\n', i), source.size());
    } else if (source[i] == '\'' && i + 2 < source.size()) {
      i += source[i + 1] == '\\' ? 3 : 2;
    } else if (source[i] == '"') {
      for (++i; i < source.size() && source[i] != '"'; ++i) {
        if (source[i] == '\\') {
          ++i;
          text += ' ';  // "--wait\n"
          continue;
        }
        text += source[i];
      }
      text += '\n';
    }
  }
  return text;
}

std::string Read(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::set<std::string> KnownOptions() {
  std::set<std::string> known;
  for (const char* program : {"rigcal", "rigcal-agent", "rigcal-server", "rigcal-worker"}) {
    Collect({program}, &known);
  }
  return known;
}

TEST(OptionsInMessages, AllExist) {
  const std::set<std::string> known = KnownOptions();
  for (const char* option : {"--target", "--data-dir", "--source", "--memory", "--force"}) {
    ASSERT_THAT(known, Contains(option));
  }
  std::map<std::string, std::string> unknown;  // the first file that names it
  for (const char* layer : {"agent", "client", "common", "server"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(RIGCAL_SOURCE_DIR) / layer)) {
      const fs::path& path = entry.path();
      const std::string file = fs::relative(path, RIGCAL_SOURCE_DIR).string();
      if (path.extension() != ".cc" && path.extension() != ".h") continue;
      // They write scripts and commands of other programs.
      if (file == "common/export/ros_writer.cc" || file == "common/export/blender_writer.cc" ||
          file == "common/import/ros_import.cc") {
        continue;
      }
      for (const std::string& option : OptionsIn(Literals(Read(path)))) {
        // The name of before, which is refused.
        if (known.contains(option) || option == "--out") continue;
        unknown.emplace(option, file);
      }
    }
  }
  EXPECT_THAT(unknown, IsEmpty());
}

TEST(OptionsInMessages, TheScanSeesWhatIsWrong) {
  EXPECT_THAT(OptionsIn(Literals("x(\"give --nonesuch N\"); // --comment")),
              ::testing::ElementsAre("--nonesuch"));
  EXPECT_THAT(OptionsIn("a--b ---c (--d-e)"), ::testing::ElementsAre("--d-e"));
}

TEST(OptionsInMessages, EveryCommandTellsItsVersion) {
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"rigcal"},
                                             {"rigcal", "session", "create"},
                                             {"rigcal-agent"},
                                             {"rigcal-agent", "detect"},
                                             {"rigcal-server"},
                                             {"rigcal-server", "backup"},
                                             {"rigcal-worker"}}) {
    std::vector<std::string> asked = command;
    asked.emplace_back("--version");
    const CommandResult version = RunCommand(asked);
    EXPECT_EQ(version.exit_code, 0) << version.error;
    EXPECT_THAT(version.output, ::testing::StartsWith(command[0] + " 0."));
  }
}

}  // namespace
}  // namespace rigcal::testing::options_in_messages_test
