// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace rigcal::testing {

// The layer rules of ARCHITECTURE.md, applied to one `#include` in one file. `file` is the path
// from the project's root, `include` what stands between the quotes or brackets. Empty: allowed;
// else the rule that forbids it.
std::string ForbiddenBecause(std::string_view file, std::string_view include);

// Folders and those they may include.
using FolderGraph = std::map<std::string, std::set<std::string>>;

// The folders of the product and those they may include besides themselves. A program's main.cc may
// include everything of its own layer and of common.
const FolderGraph& AllowedFolders();

// "a -> b -> a"; empty: the graph has no cycle.
std::string CycleOf(const FolderGraph& graph);

// What a source text includes, in order.
std::vector<std::string> IncludesOf(std::string_view text);

}  // namespace rigcal::testing
