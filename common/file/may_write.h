// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "absl/status/status.h"

namespace rigcal {

// Before a file that a user has asked for is made: ALREADY_EXISTS where there is one of that name
// and it is not to be replaced; the message names --force.
absl::Status CheckMayWrite(const std::filesystem::path& path, bool replace);

// The same, and NOT_FOUND, with the name of the folder, where the one that the file would be in
// does not exist. `option` is the one that names the file.
absl::Status CheckOutputFile(const std::filesystem::path& path, bool replace,
                             std::string_view option = "--output");

}  // namespace rigcal
