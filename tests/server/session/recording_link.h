// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/session/agent_link.h"

namespace rigcal::testing {

// Records commands to an agent, one line each: "start s-1 left/1=12 right/1=0", "stop s-1",
// "preview left", "detector left", "close ABORTED: ...". Thread-safe.
class RecordingLink : public server::AgentLink {
 public:
  void SendStartCapture(const StartCaptureCommand& command) override;
  void SendStopCapture(const std::string& session_id) override;
  void SendPreviewRequest(const PreviewRequest& request) override;
  void SendDetectorRequest(const DetectorRequest& request) override;
  void SendChoiceRequest(const ChoiceRequest& request) override;
  void Close(const absl::Status& reason) override;

  std::vector<std::string> Lines() const;
  // OK: not closed.
  absl::Status closed() const;

 private:
  void Add(std::string line);

  mutable std::mutex mutex_;
  std::vector<std::string> lines_;
  absl::Status closed_;
};

}  // namespace rigcal::testing
