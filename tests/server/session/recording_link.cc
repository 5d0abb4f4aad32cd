// SPDX-License-Identifier: Apache-2.0
#include "tests/server/session/recording_link.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::testing {

void RecordingLink::SendStartCapture(const StartCaptureCommand& command) {
  std::string line = absl::StrCat("start ", command.session_id);
  for (const StreamPosition& camera : command.cameras) {
    absl::StrAppend(&line, " ", camera.stream.camera, "/", camera.stream.stream_epoch, "=",
                    camera.durable_seq);
  }
  Add(std::move(line));
}

void RecordingLink::SendStopCapture(const std::string& session_id) {
  Add(absl::StrCat("stop ", session_id));
}

void RecordingLink::SendPreviewRequest(const PreviewRequest& request) {
  Add(absl::StrCat("preview ", request.camera));
}

void RecordingLink::SendDetectorRequest(const DetectorRequest& request) {
  Add(absl::StrCat("detector ", request.camera));
}

void RecordingLink::SendChoiceRequest(const ChoiceRequest& request) {
  Add(absl::StrCat(request.device.empty() ? "drop " : "use ", request.camera));
}

void RecordingLink::Close(const absl::Status& reason) {
  Add(absl::StrCat("close ", reason.ToString()));
  std::lock_guard lock(mutex_);
  closed_ = reason;
}

std::vector<std::string> RecordingLink::Lines() const {
  std::lock_guard lock(mutex_);
  return lines_;
}

absl::Status RecordingLink::closed() const {
  std::lock_guard lock(mutex_);
  return closed_;
}

void RecordingLink::Add(std::string line) {
  std::lock_guard lock(mutex_);
  lines_.push_back(std::move(line));
}

}  // namespace rigcal::testing
