// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/session/stream_key.h"
#include "common/target/target.h"

namespace rigcal {

// How much of a stream is on the server's disk, and how far its agent may send.
struct StreamPosition {
  StreamKey stream;
  uint32_t durable_seq = 0;
  uint32_t send_limit_seq = 0;
  bool unknown = false;  // the server takes nothing of this stream
};

// Tells an agent to capture with some of its cameras.
struct StartCaptureCommand {
  std::string session_id;
  Target target;
  std::vector<StreamPosition> cameras;  // the agent's cameras that take part
};

}  // namespace rigcal
