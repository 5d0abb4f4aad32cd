// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/session/preview.h"
#include "common/session/stream_key.h"
#include "common/target/target.h"

namespace rigcal::server {

// How far a stream is on this server's disk, and how far its agent may send.
struct StreamPosition {
  StreamKey stream;
  uint32_t durable_seq = 0;
  uint32_t send_limit_seq = 0;
  bool unknown = false;  // nothing of this stream will be taken
};

// What an agent is told when its cameras are to capture.
struct StartCaptureCommand {
  std::string session_id;
  Target target;
  std::vector<StreamPosition> cameras;  // the agent's cameras that take part
};

// Sends to one connected agent; implemented by the RPC layer. Thread-safe; never blocks; a
// call on a link whose stream has ended does nothing.
class AgentLink {
 public:
  virtual ~AgentLink() = default;
  virtual void SendStartCapture(const StartCaptureCommand& command) = 0;
  virtual void SendStopCapture(const std::string& session_id) = 0;
  virtual void SendPreviewRequest(const PreviewRequest& request) = 0;
  // Ends the stream with `reason`.
  virtual void Close(const absl::Status& reason) = 0;
};

}  // namespace rigcal::server
