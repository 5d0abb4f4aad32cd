// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "absl/status/status.h"

namespace rigcal {

// Names of rigs, cameras, sessions and agents: 1 to 64 letters, digits, '_', '-' or '.', not
// beginning with '.'. `what` begins the error message: "camera name".
absl::Status ValidateName(std::string_view what, std::string_view name);

}  // namespace rigcal
