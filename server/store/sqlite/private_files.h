// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// Files that only their user can read. Errors name the file: RESOURCE_EXHAUSTED where the disk is
// full, else FAILED_PRECONDITION.

// A new, empty file of mode 0600.
absl::Status CreatePrivateFile(const std::filesystem::path& file);
absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& file);
// A new file with these bytes, synced.
absl::Status WritePrivateFile(const std::filesystem::path& file, std::string_view bytes);
// Gives a finished file its name; both survive a power cut.
absl::Status SyncAndRename(const std::filesystem::path& from, const std::filesystem::path& to);
// The entries of a folder survive a power cut.
void SyncFolder(const std::filesystem::path& folder);

}  // namespace rigcal::server
