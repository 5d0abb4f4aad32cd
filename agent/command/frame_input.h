// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/frame_source_spec.h"

namespace rigcal::agent {

// The frames a subcommand works on, as typed.
struct FrameInput {
  std::string input = {};  // an image, a folder, a video, events, or a SPEC as for --source
  std::string config = {};
  std::string camera = {};
  std::string calibration = {};
  std::string fps = {};
  std::vector<std::string> settings = {};  // OPTION=VALUE
};

void AddFrameInput(CLI::App& command, FrameInput* input);

// What was typed, of any kind of source, without a pace unless one is given. A path is one of
// frames, or by its ending one of events; without a calibration beside it it is taken for a camera
// without one. INVALID_ARGUMENT: what was typed or the configuration is wrong.
absl::StatusOr<std::unique_ptr<SourceSpec>> ResolveInput(const FrameInput& input);
// The same; INVALID_ARGUMENT also: it is no source of frames.
absl::StatusOr<std::unique_ptr<FrameSourceSpec>> ResolveFrameInput(const FrameInput& input);

}  // namespace rigcal::agent
