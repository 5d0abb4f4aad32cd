// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace rigcal::agent {

// A line for each kind of source: how its SPEC begins, and what it is.
std::string SourceSummaries();

// Every option of the kinds of one name. INVALID_ARGUMENT: there is no such kind.
absl::StatusOr<std::string> SourceOptionsHelp(std::string_view kind_name);

// docs/sources.md: all of it.
std::string SourcesMarkdown();

}  // namespace rigcal::agent
