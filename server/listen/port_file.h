// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"

namespace rigcal::server {

// Writes a port as one line to a file, for programs that start the server and wait for it. Atomic:
// a reader finds the whole number or no file. UNAVAILABLE: it cannot be written.
absl::Status WritePortFile(const std::string& path, int port);

}  // namespace rigcal::server
