// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"

namespace rigcal::server {

// Replaces a file by this text, mode 0600. A reader finds the old text or the new one, also after a
// power cut. Errors name the file.
absl::Status ReplaceDurably(const std::filesystem::path& path, const std::string& text);

}  // namespace rigcal::server
