// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace rigcal::server {

// The commands of rigcal-server for the care of its data: check, backup, restore, compact. All but
// restore work while a server runs on the data.
class CareCommands {
 public:
  // Adds the commands to `app`, which outlives them.
  explicit CareCommands(CLI::App* app);

  // One of them was on the command line that `app` has parsed.
  bool chosen() const;
  // Runs it on this data directory; results on stdout, errors and progress on stderr. Returns the
  // exit code: 0; 1 when it failed or the data is damaged.
  int Run(const std::string& data_directory) const;

 private:
  int Check(const std::string& data_directory) const;
  int BackUp(const std::string& data_directory) const;
  int Restore(const std::string& data_directory) const;
  int Compact(const std::string& data_directory) const;

  CLI::App* check_;
  CLI::App* backup_;
  CLI::App* restore_;
  CLI::App* compact_;
  std::string file_;
  std::string server_;
  bool take_damaged_ = false;
};

}  // namespace rigcal::server
