// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

namespace rigcal {

// A file and everything that is wrong in it, each fault as `file:line: what`.
struct TomlFile {
  std::string path;
  toml::table root;
  std::vector<std::string> faults;

  void AddFault(const toml::node& node, const std::string& what);
  // OK, or INVALID_ARGUMENT with every fault on a line of its own.
  absl::Status Result() const;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT: it is not TOML; file and line are named.
absl::StatusOr<TomlFile> ReadTomlFile(const std::string& path);

// One table of a file. Each Take reads a key if it is there, leaves `value` alone if not, and notes
// a fault if it is of the wrong type; keys that nobody took are faults too.
class TomlSection {
 public:
  // Both outlive the section.
  TomlSection(TomlFile* file, const toml::table& table) : file_(file), table_(table) {}

  // True: the key is there and `value` is set.
  bool Take(std::string_view key, std::string* value);
  bool Take(std::string_view key, double* value);  // whole numbers too; finite
  bool Take(std::string_view key, int64_t* value);
  bool Take(std::string_view key, bool* value);
  // The node itself; none: not there. It counts as taken.
  const toml::node* TakeNode(std::string_view key);

  // A fault of a key that was taken.
  void AddFault(std::string_view key, const std::string& what);
  void RefuseOtherKeys();

 private:
  TomlFile* const file_;
  const toml::table& table_;
  std::set<std::string, std::less<>> taken_;
};

}  // namespace rigcal
