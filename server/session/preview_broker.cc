// SPDX-License-Identifier: Apache-2.0
#include "server/session/preview_broker.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "server/session/find_camera.h"

namespace rigcal::server {
namespace {

absl::StatusCode CodeOf(PreviewStatus status) {
  switch (status) {
    case PreviewStatus::kOk:
      return absl::StatusCode::kOk;
    case PreviewStatus::kDisabled:
    case PreviewStatus::kNoFrames:
    case PreviewStatus::kNotCapturing:
      return absl::StatusCode::kFailedPrecondition;
    case PreviewStatus::kUnknownCamera:
      return absl::StatusCode::kNotFound;
    case PreviewStatus::kTooOften:
      return absl::StatusCode::kResourceExhausted;
    case PreviewStatus::kTimedOut:
      return absl::StatusCode::kAborted;
    case PreviewStatus::kFailed:
      break;
  }
  return absl::StatusCode::kInternal;
}

}  // namespace

absl::StatusOr<PreviewBroker::CameraPreview> PreviewBroker::Get(
    const std::string& rig, const std::string& camera, std::chrono::milliseconds wait,
    const std::function<bool()>& is_cancelled) {
  if (wait.count() <= 0) wait = options_.default_wait;
  if (wait > options_.longest_wait) {
    return absl::InvalidArgumentError(absl::StrCat("max_wait is ", wait.count(), " ms, at most ",
                                                   options_.longest_wait.count(),
                                                   " ms are allowed"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const AgentDirectory::ConnectedCamera connected,
                          FindCamera(directory_, rig, camera));
  CameraPreview result{.agent_id = connected.agent_id, .rig = connected.rig, .preview = {}};
  RIGCAL_ASSIGN_OR_RETURN(const uint32_t id, questions_.Enter(absl::StrCat(result.rig, "/", camera),
                                                              connected.registration));
  connected.link->SendPreviewRequest({.request_id = id,
                                      .camera = camera,
                                      .max_jpeg_bytes = options_.max_jpeg_bytes,
                                      .max_wait_ms = static_cast<uint32_t>(wait.count())});
  RIGCAL_ASSIGN_OR_RETURN(result.preview,
                          questions_.Await(id, wait + options_.answer_grace, is_cancelled));
  const Preview& preview = result.preview;
  if (preview.status != PreviewStatus::kOk) {
    return absl::Status(CodeOf(preview.status), preview.message);
  }
  if (preview.info.camera != camera || preview.jpeg.size() > options_.max_jpeg_bytes) {
    return absl::InternalError(absl::StrCat("agent '", result.agent_id, "' answered with ",
                                            preview.jpeg.size(), " bytes of camera '",
                                            preview.info.camera, "', which was not asked for"));
  }
  return result;
}

void PreviewBroker::TakeAnswer(AgentDirectory::Registration registration, Preview preview) {
  const uint32_t id = preview.request_id;
  questions_.Take(registration, id, std::move(preview));
}

}  // namespace rigcal::server
