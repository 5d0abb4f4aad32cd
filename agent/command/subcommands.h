// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "common/command_line/command_line.h"

namespace rigcal::agent {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = kUsageExitCode;
inline constexpr int kExitUndelivered = 3;

// INVALID_ARGUMENT: a wrong command line; any other error: the command failed.
inline int ExitCodeOf(const absl::Status& status) {
  if (status.ok()) return kExitOk;
  return absl::IsInvalidArgument(status) ? kExitUsage : kExitFailed;
}

// The subcommands of rigcal-agent. Add before parsing; after it, Chosen runs the one that was asked
// for. `out` outlives the object.
class Subcommands {
 public:
  explicit Subcommands(std::ostream& out) : out_(out) {}
  Subcommands(const Subcommands&) = delete;
  Subcommands& operator=(const Subcommands&) = delete;
  void AddTo(CLI::App& app);
  // Empty: none was asked for.
  const std::function<absl::Status()>& Chosen() const { return chosen_; }

  // Adds one that calls `run`; its flags are set by the options that the caller adds.
  template <typename Flags>
  std::pair<CLI::App&, Flags&> Add(CLI::App& app, const std::string& name,
                                   const std::string& description,
                                   absl::Status (*run)(const Flags&, std::ostream&)) {
    CLI::App* const command = app.add_subcommand(name, description);
    const auto flags = std::make_shared<Flags>();
    command->callback(
        [this, flags, run] { chosen_ = [this, flags, run] { return run(*flags, out_); }; });
    return {*command, *flags};
  }

 private:
  std::ostream& out_;
  std::function<absl::Status()> chosen_;
};

// Options that several commands share: what they print, and the file that they write, with --force.
CLI::Option* AddFormatOption(CLI::App& command, std::string* format, const std::string& what);
CLI::Option* AddOutputOption(CLI::App& command, std::string* path, bool* force,
                             const std::string& what);

void AddCamerasCommand(CLI::App& app, Subcommands* all);
void AddConvertCommand(CLI::App& app, Subcommands* all);
void AddDetectCommand(CLI::App& app, Subcommands* all);
void AddInfoCommand(CLI::App& app, Subcommands* all);
void AddIntrinsicsCommand(CLI::App& app, Subcommands* all);
void AddJoinCommand(CLI::App& app, Subcommands* all);
void AddMaskCommand(CLI::App& app, Subcommands* all);
void AddSimulateCommand(CLI::App& app, Subcommands* all);
void AddSourcesCommand(CLI::App& app, Subcommands* all);
void AddTuneCommand(CLI::App& app, Subcommands* all);

}  // namespace rigcal::agent
