// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal {

// Every program ends with this where its command line is wrong.
inline constexpr int kUsageExitCode = 2;

enum class CommandLineTask {
  kRun,   // what was typed is to be done
  kDone,  // help or the version was asked for, and is written
};

// Gives a program and each of its commands the flag --version. Call it once all commands are added.
void AddVersionFlags(CLI::App& app, const std::string& version);

// The option `old_name` of before: whoever types it is told `instead`, such as "--output FILE".
void AddFormerOption(CLI::App* app, const std::string& old_name, const std::string& instead);

// Reads `arguments`, which are behind the program's name. Help and version go to `out`.
// INVALID_ARGUMENT: the command line is wrong; the message, one line, names what is wrong and what
// was probably meant.
absl::StatusOr<CommandLineTask> ParseCommandLine(CLI::App& app,
                                                 const std::vector<std::string>& arguments,
                                                 std::ostream& out);

// The same for the arguments of main.
absl::StatusOr<CommandLineTask> ParseCommandLine(CLI::App& app, int argc, char** argv,
                                                 std::ostream& out);

}  // namespace rigcal
