// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "client/commands/command_context.h"
#include "client/net/paging.h"

namespace rigcal::client {

// `rigcal agent list`: agents that are connected or were since the server started, with their
// cameras.
ExitCode ListAgents(const ListOptions& options, CommandContext& context);

struct AgentPreviewOptions {
  std::string camera;
  std::string rig;   // empty: the one that has the camera
  std::string file;  // empty: CAMERA.jpg in the current folder
  bool force = false;  // replace a file that is there
};

// `rigcal agent preview`: writes the next picture of a camera, with what its agent's detector sees
// in it, as JPEG. A file of that name stays, or is replaced at once with `force`.
ExitCode PreviewCamera(const AgentPreviewOptions& options, CommandContext& context);

struct CameraMoveOptions {
  std::string camera;
  std::string agent_id;
  std::string rig;  // empty: "rig"
};

// `rigcal camera move`: gives a camera to another agent.
ExitCode MoveCamera(const CameraMoveOptions& options, CommandContext& context);

}  // namespace rigcal::client
