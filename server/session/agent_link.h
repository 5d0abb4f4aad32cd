// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/session/capture_command.h"
#include "common/session/detector.h"
#include "common/session/offer.h"
#include "common/session/preview.h"

namespace rigcal::server {

// Sends to one connected agent; implemented by the RPC layer. Thread-safe; never blocks; a
// call on a link whose stream has ended does nothing.
class AgentLink {
 public:
  virtual ~AgentLink() = default;
  virtual void SendStartCapture(const StartCaptureCommand& command) = 0;
  virtual void SendStopCapture(const std::string& session_id) = 0;
  virtual void SendPreviewRequest(const PreviewRequest& request) = 0;
  virtual void SendDetectorRequest(const DetectorRequest& request) = 0;
  virtual void SendChoiceRequest(const ChoiceRequest& request) = 0;
  // Ends the stream with `reason`.
  virtual void Close(const absl::Status& reason) = 0;
};

}  // namespace rigcal::server
