// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/options/option_table.h"
#include "common/status/fault_list.h"

namespace rigcal {

// A file and everything that is wrong in it, each fault as `file:line: what`.
struct TomlFile {
  std::string path;
  toml::table root;
  FaultList faults;

  std::string PlaceOf(const toml::node& node) const;  // "agent.toml:12"
  void AddFault(const toml::node& node, const std::string& what);
  // OK, or INVALID_ARGUMENT with every fault on a line of its own.
  absl::Status Result() const { return faults.Result("", "\n"); }
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: it is not TOML; file and line are named.
absl::StatusOr<TomlFile> ReadTomlFile(const std::string& path);

// A value as an option table reads it. INVALID_ARGUMENT: a table, a list or an empty text.
absl::StatusOr<OptionText> OptionOf(const TomlFile& file, std::string_view key,
                                    const toml::node& value);

// One table of a file. Each Take reads a key if it is there and adds a fault if its value is of the
// wrong type; keys that nobody took are faults of RefuseOtherKeys.
class TomlSection {
 public:
  // Both outlive the section.
  TomlSection(TomlFile* file, const toml::table& table) : file_(file), table_(table) {}

  // Every key that the options have.
  void Take(const OptionTable& options);
  // [key] or, as a list of tables, [[key]]. Null or empty: not there.
  const toml::table* TakeTable(std::string_view key);
  std::vector<const toml::table*> TakeTables(std::string_view key);
  // The node itself. Null: not there.
  const toml::node* TakeNode(std::string_view key);

  // Of a key that is there.
  void AddFault(std::string_view key, const std::string& what);
  void RefuseOtherKeys();

 private:
  TomlFile* const file_;
  const toml::table& table_;
  std::vector<std::string> known_;
};

// The table [key] of a section into the options of a struct, unknown keys refused.
void ReadTable(TomlFile* file, TomlSection* section, std::string_view key,
               const OptionTable& options);

}  // namespace rigcal
