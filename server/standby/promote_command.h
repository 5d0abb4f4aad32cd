// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace rigcal::server {

// `rigcal-server promote`: a standby takes over.
class PromoteCommand {
 public:
  // Adds the command to `app`, which outlives it.
  explicit PromoteCommand(CLI::App* app);

  bool chosen() const { return promote_->parsed(); }
  // Asks the standby that runs on the folder, or, where none runs, changes the folder, so that the
  // next server on it serves. Returns the exit code.
  int Run(const std::string& data_dir) const;

 private:
  CLI::App* promote_;
  bool force_ = false;
};

}  // namespace rigcal::server
