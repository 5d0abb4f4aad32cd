// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace rigcal::testing {

// The layer rules of ARCHITECTURE.md, applied to one `#include` in one file. `file` is the path
// from the project's root, `include` what stands between the quotes or brackets. Empty: allowed;
// else the rule that forbids it.
std::string ForbiddenBecause(std::string_view file, std::string_view include);

// Folders that do not include each other, and may include all folders of the layers before theirs
// that are of common or of their own program. A program's main.cc may include everything of its
// program and of common.
struct Layer {
  std::string name;
  std::set<std::string> folders;
};
const std::vector<Layer>& Layers();

// Folders, with those in them, that see nothing of their program but each other.
struct Island {
  std::vector<std::string> folders;
  std::string why;
};
const std::vector<Island>& Islands();

// What a source text includes, in order.
std::vector<std::string> IncludesOf(std::string_view text);

}  // namespace rigcal::testing
