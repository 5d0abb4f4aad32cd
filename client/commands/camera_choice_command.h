// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/camera_command.h"
#include "client/commands/command_context.h"

namespace rigcal::client {

struct CameraListOptions {
  std::string rig;       // empty: every rig
  std::string agent_id;  // empty: every agent
  bool json = false;     // whatever -o says
  bool all = false;      // every camera, however many there are
};

// `rigcal cameras`: what each connected agent offers, and what takes part.
ExitCode ListCameras(const CameraListOptions& options, CommandContext& context);

struct CameraUseOptions {
  std::string device;            // "AGENT/DEVICE", or "DEVICE" of the agent that offers it
  std::string camera;            // name within the rig
  std::string calibration_file;  // OpenCV YAML; empty: none
};

// `rigcal cameras use`: has an agent use a camera, and waits until it takes part.
ExitCode UseCamera(const CameraUseOptions& options, CommandContext& context);

// `rigcal cameras drop`: ends that, and waits until it takes no part.
ExitCode DropCamera(const CameraOptions& options, CommandContext& context);

}  // namespace rigcal::client
