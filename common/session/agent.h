// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/session/stream_key.h"

namespace rigcal {

struct AnnouncedCamera {
  CameraDescription description;
  uint32_t stream_epoch = 1;  // of new observations of this camera
};

// An agent as it announces itself, and its connection.
struct AgentRecord {
  std::string agent_id;
  uint32_t incarnation = 0;  // grows at each start of the agent
  uint32_t connection = 0;   // grows at each connection within an incarnation
  std::string host;
  std::string software_version;
  std::string rig;
  std::vector<AnnouncedCamera> cameras;
  // Filled by the server's directory of agents.
  bool connected = false;
  int64_t connect_utc_ns = 0;
  int64_t disconnect_utc_ns = 0;  // 0 while connected
};

// An agent's first message: who it is, and which streams it has yet to deliver.
struct AgentHello {
  AgentRecord agent;
  std::vector<StreamKey> pending;
};

}  // namespace rigcal
