// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace rigcal::server {

// The commands of rigcal-server for the care of its data: check, backup, restore, compact, and
// `store copy`. All but restore and copy work while a server runs on the data.
class CareCommands {
 public:
  // Adds the commands to `app`, which outlives them.
  explicit CareCommands(CLI::App* app);

  // One of them was on the command line that `app` has parsed.
  bool chosen() const;
  // Runs it on this data directory, or on the database elsewhere whose address `store` is (empty:
  // none), for which PostgreSQL has programs of its own but for check; results on stdout, errors
  // and progress on stderr. Returns the exit code: 0; 1 when it failed or the data is damaged.
  int Run(const std::string& data_directory, const std::string& store) const;

 private:
  int RunElsewhere(const std::string& store) const;
  int CheckElsewhere(const std::string& store) const;
  int Copy() const;
  int Check(const std::string& data_directory) const;
  int BackUp(const std::string& data_directory) const;
  int Restore(const std::string& data_directory) const;
  int Compact(const std::string& data_directory) const;

  CLI::App* check_;
  CLI::App* backup_;
  CLI::App* restore_;
  CLI::App* compact_;
  CLI::App* copy_;
  std::string file_;
  std::string from_;
  std::string to_;
  std::string server_;
  bool take_damaged_ = false;
};

}  // namespace rigcal::server
