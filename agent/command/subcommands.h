// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <ostream>
#include <vector>

#include "absl/status/status.h"

namespace rigcal::agent {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;

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
  void AddTo(CLI::App& app);
  // Empty: none was asked for.
  const std::function<absl::Status()>& Chosen() const { return chosen_; }

 private:
  std::ostream& out_;
  std::function<absl::Status()> chosen_;
};

// Each adds one subcommand, which sets `chosen` when it is selected.
void AddConvertCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddDetectCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddInfoCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddMaskCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddSimulateCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddSourcesCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);
void AddTuneCommand(CLI::App& app, std::ostream& out, std::function<absl::Status()>* chosen);

}  // namespace rigcal::agent
