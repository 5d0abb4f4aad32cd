// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal {

// A file whole or not at all, also after power loss: written to a temporary file of mode 0600,
// synced, renamed, the folder synced. Errors of the file system name the path.
absl::Status WriteDurableFile(const std::filesystem::path& path, std::string_view text);

// At most 1 MiB. NOT_FOUND: there is no such file. Others name the path.
absl::StatusOr<std::string> ReadSmallFile(const std::filesystem::path& path);

// A folder that only its owner may enter (0700), made where it is missing.
absl::Status MakePrivateFolder(const std::filesystem::path& path);

}  // namespace rigcal
