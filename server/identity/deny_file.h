// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace rigcal::server {

// Certificates that are not accepted any more, denied.json:
//   {"denied": [{"uri": "rigcal://agents/pc-1", "serials": ["4f2a...", ...], "time": "2026-..."}]}
// Serials are as in Certificate::serial. An entry without serials denies every certificate of that
// URI; rigcal writes none of these, so that a name can join again.

// False where there is no file. DATA_LOSS: it is damaged, and so everybody must be refused.
absl::StatusOr<bool> IsDenied(const std::filesystem::path& file, std::string_view uri,
                              std::string_view serial);
// Adds to the file; on disk when it returns. DATA_LOSS as above.
absl::Status DenyCertificates(const std::filesystem::path& file, const std::string& uri,
                              const std::set<std::string>& serials, absl::Time now);

}  // namespace rigcal::server
