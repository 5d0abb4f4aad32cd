// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/commands/exit_code.h"
#include "client/output/console.h"
#include "client/output/output.h"

namespace rigcal::client {

// What every command gets besides its own options.
struct CommandContext {
  Console& console;
  // HOST:PORT.
  std::string server;

  // Says what went wrong; returns the exit code for it.
  ExitCode Fail(const absl::Status& status) {
    console.Message(std::string(status.message()));
    return ExitCodeOf(status);
  }

  // Prints an answer, as JSON or as `format` writes it for people, or says what went wrong.
  template <typename Message, typename Format>
  ExitCode Show(const absl::StatusOr<Message>& answer, const Format& format) {
    if (!answer.ok()) return Fail(answer.status());
    if (console.format == OutputFormat::kJson) {
      console.out << ToJson(*answer) << "\n" << std::flush;
    } else {
      console.Print(format(*answer));
    }
    return ExitCode::kOk;
  }
};

// The files that a command has written, of the `kind` ("session") with this id.
void PrintFiles(const char* kind, const std::string& id,
                const std::vector<std::filesystem::path>& files, CommandContext& context);

// Asks whether `deed` ("delete session wave") is meant. kUsage: nobody can be asked, so --yes must
// be there; kFailed: the answer is no. Both are said.
ExitCode Confirm(Console& console, const std::string& deed);

}  // namespace rigcal::client
