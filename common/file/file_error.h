// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "absl/status/status.h"

namespace rigcal {

// "cannot WHAT PATH: why", with what to do where that is known.
//   NOT_FOUND            there is no such file or folder
//   RESOURCE_EXHAUSTED   the disk is full, or a quota or a limit of this process is reached
//   INTERNAL             the disk failed
//   FAILED_PRECONDITION  anything else: permissions, kinds of file
absl::Status FileError(std::string_view what, const std::filesystem::path& path, int error);

}  // namespace rigcal
