// SPDX-License-Identifier: Apache-2.0
#include "server/session/detector_broker.h"

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/find_camera.h"

namespace rigcal::server {

absl::StatusOr<DetectorBroker::CameraDetector> DetectorBroker::Ask(
    const std::string& rig, DetectorRequest request, const std::function<bool()>& is_cancelled) {
  RIGCAL_ASSIGN_OR_RETURN(const AgentDirectory::ConnectedCamera connected,
                          FindCamera(directory_, rig, request.camera));
  RIGCAL_ASSIGN_OR_RETURN(
      request.request_id,
      questions_.Enter(absl::StrCat(connected.rig, "/", request.camera), connected.registration));
  connected.link->SendDetectorRequest(request);
  absl::StatusOr<DetectorAnswer> answer =
      questions_.Await(request.request_id, options_.longest_wait, is_cancelled);
  if (!answer.ok()) {
    if (!absl::IsAborted(answer.status())) return answer.status();
    return absl::AbortedError(absl::StrCat(std::string(answer.status().message()),
                                           "; ask again, and if it never answers, update it"));
  }
  RIGCAL_RETURN_IF_ERROR(answer->status);
  return CameraDetector{connected.agent_id, connected.rig, std::move(answer->state)};
}

}  // namespace rigcal::server
