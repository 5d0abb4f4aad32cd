// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"

namespace rigcal::server {

// The recording `ewand` in the folder of recordings, with its authors' wand spacing.
absl::StatusOr<CalibrationInput> RecordedInput(const std::filesystem::path& data);

}  // namespace rigcal::server
