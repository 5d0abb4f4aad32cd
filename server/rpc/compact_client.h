// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"

namespace rigcal::server {

// How far a running server is with compacting.
struct CompactProgress {
  double fraction = 0;  // 0 to 1
  uint64_t size_bytes = 0;
};

// Asks the server at `address` (on this machine: HOST:PORT, or unix:FILE) to compact its database,
// and waits for its end. UNAVAILABLE: nobody answers there. Else the server's error.
absl::Status CompactRunningServer(const std::string& address,
                                  const std::function<void(const CompactProgress&)>& progress);

}  // namespace rigcal::server
