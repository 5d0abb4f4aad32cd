// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "absl/status/statusor.h"
#include "server/solve/calibrate.h"

namespace rigcal::server {

// The recording `ewand` in the folder of recordings, with its authors' wand spacing.
absl::StatusOr<CalibrationInput> RecordedInput(const std::filesystem::path& data);

// The recording `flight` of four consumer cameras without a common clock: one point, a drone.
absl::StatusOr<CalibrationInput> RecordedFlight(const std::filesystem::path& data);

}  // namespace rigcal::server
