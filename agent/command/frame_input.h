// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/source_spec.h"

namespace rigcal::agent {

// Which pictures a subcommand looks at, as typed.
struct FrameInput {
  std::string input = {};  // a picture, a folder, a video, or a SPEC as for --source
  std::string config = {};
  std::string camera = {};
  std::string calibration = {};
  std::string fps = {};
  std::vector<std::string> settings = {};  // KEY=VALUE
};

void AddPictureInput(CLI::App& command, FrameInput* input);

// The source of these pictures, as fast as it goes unless said otherwise. A path without a
// calibration beside it is taken for a camera without one.
// INVALID_ARGUMENT: what was typed is wrong, or is no source of pictures; the configuration is
// wrong.
absl::StatusOr<FrameSourceSpec> ResolvePictureInput(const FrameInput& input);

}  // namespace rigcal::agent
