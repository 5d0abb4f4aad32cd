// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rigcal::testing {

// The layer rules of ARCHITECTURE.md, applied to one `#include` in one file. `file` is the path
// from the project's root, `include` what stands between the quotes or brackets. Empty: allowed;
// else the rule that forbids it.
std::string ForbiddenBecause(std::string_view file, std::string_view include);

// What a source text includes, in order.
std::vector<std::string> IncludesOf(std::string_view text);

}  // namespace rigcal::testing
