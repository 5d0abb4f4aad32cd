// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "client/commands/command_context.h"

namespace rigcal::client {

struct CameraOptions {
  std::string camera;
  std::string rig;  // empty: the one that has the camera
};

// `rigcal camera detector`: the colour that a camera's detector looks for and what it ignores.
ExitCode ShowDetector(const CameraOptions& options, CommandContext& context);

struct CameraMaskOptions : CameraOptions {
  uint32_t frame_count = 0;  // 0: the agent's default
  bool clear = false;        // forget the learnt mask
};

// `rigcal camera mask`: learns static bright spots on the running agent, and waits for the result.
ExitCode LearnCameraMask(const CameraMaskOptions& options, CommandContext& context);

struct CameraTuneOptions : CameraOptions {
  uint32_t frame_count = 0;  // 0: the agent's default
};

// `rigcal camera tune`: learns the wand's colour on the running agent, and waits for the result.
ExitCode TuneCamera(const CameraTuneOptions& options, CommandContext& context);

// What is not given stays as it is.
struct CameraColourOptions : CameraOptions {
  std::optional<double> hue_min_deg;
  std::optional<double> hue_max_deg;
  std::optional<double> saturation_min;
  std::optional<uint32_t> value_min;
  std::optional<uint32_t> washed_out_min;
  bool reset = false;  // back to the agent's configuration
};

// `rigcal camera colour`: sets the colour that a camera's detector looks for.
ExitCode SetCameraColour(const CameraColourOptions& options, CommandContext& context);

}  // namespace rigcal::client
