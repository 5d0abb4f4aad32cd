// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/camera/camera_description.h"
#include "common/session/spool_report.h"
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
  bool spool_survives_restart = false;
  std::vector<StreamKey> pending;  // in its spool when it connected
  // Proves which installation of the agent it is: a hash of its secret, or that a certificate names
  // it. Empty: nothing proves it. Filled by the server.
  std::string credential;
  std::string address;  // the IP address it connects from; empty: unknown. Filled by the server.
  // Filled by the server's directory of agents.
  bool connected = false;
  int64_t connect_utc_ns = 0;
  int64_t disconnect_utc_ns = 0;     // 0 while connected
  std::optional<SpoolStatus> spool;  // as last reported; none: nothing was
};

// An agent's first message: who it is, and which streams it has yet to deliver.
struct AgentHello {
  AgentRecord agent;
  std::string secret;  // of this installation; empty: it has none
  std::vector<StreamKey> pending;
  bool keeps_until_standby = false;  // its spool keeps rows until the server's standby has them
  // Of the server with the highest generation that it has spoken with; empty and 0: none.
  std::string known_server_id = {};
  uint64_t known_generation = 0;
  std::string known_generation_proof = {};  // of that server; empty: it gave none
};

}  // namespace rigcal
