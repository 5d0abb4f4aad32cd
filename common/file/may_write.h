// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/status.h"

namespace rigcal {

// Before a file that a user has asked for is made: ALREADY_EXISTS where there is one of that name
// and it is not to be replaced; the message names --force.
absl::Status CheckMayWrite(const std::filesystem::path& path, bool replace);

}  // namespace rigcal
