// SPDX-License-Identifier: Apache-2.0
#include "server/session/preview_broker.h"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"

namespace rigcal::server {
namespace {

constexpr std::chrono::milliseconds kCancellationInterval{250};
constexpr size_t kMaxListedCameras = 32;

bool Announces(const AgentRecord& agent, const std::string& camera) {
  return std::any_of(agent.cameras.begin(), agent.cameras.end(),
                     [&](const auto& announced) { return announced.description.camera == camera; });
}

// "connected are rig/left, rig/right".
std::string ConnectedText(const std::vector<AgentDirectory::ConnectedCamera>& cameras) {
  if (cameras.empty()) return "no agent is connected";
  std::set<std::string> names;
  for (const AgentDirectory::ConnectedCamera& camera : cameras) {
    names.insert(absl::StrCat(camera.rig, "/", camera.camera.description.camera));
  }
  const bool more = names.size() > kMaxListedCameras;
  while (names.size() > kMaxListedCameras) names.erase(std::prev(names.end()));
  return absl::StrCat("connected are ", absl::StrJoin(names, ", "), more ? " and others" : "");
}

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

PreviewBroker::PreviewBroker(PreviewBrokerOptions options, const AgentDirectory* directory)
    : options_(options), directory_(*directory) {}

absl::StatusOr<AgentDirectory::ConnectedCamera> PreviewBroker::Find(
    const std::string& rig, const std::string& camera) const {
  std::vector<AgentDirectory::ConnectedCamera> found = directory_.ConnectedCameras(rig);
  std::erase_if(found, [&](const auto& one) { return one.camera.description.camera != camera; });
  if (found.size() == 1) return std::move(found.front());
  if (found.size() > 1) {
    const std::string rigs =
        absl::StrJoin(found, ", ", [](std::string* out, const auto& one) { out->append(one.rig); });
    return absl::InvalidArgumentError(
        absl::StrCat("several rigs have a camera '", camera, "': ", rigs, "; name one of them"));
  }
  for (const AgentRecord& agent : directory_.List(rig)) {
    if (!Announces(agent, camera)) continue;
    return absl::FailedPreconditionError(
        absl::StrCat("agent '", agent.agent_id, "' on host '", agent.host, "', which has camera '",
                     agent.rig, "/", camera, "', is not connected; start it again"));
  }
  return absl::NotFoundError(absl::StrCat("no agent has a camera '", rig, rig.empty() ? "" : "/",
                                          camera, "'; ",
                                          ConnectedText(directory_.ConnectedCameras(""))));
}

absl::StatusOr<uint32_t> PreviewBroker::Enter(const std::string& rig, const std::string& camera,
                                              AgentDirectory::Registration registration) {
  const std::string rig_and_camera = absl::StrCat(rig, "/", camera);
  const std::lock_guard lock(mutex_);
  if (shut_down_) return absl::UnavailableError("the server is shutting down");
  for (const auto& [id, waiting] : waiting_) {
    if (waiting.rig_and_camera != rig_and_camera) continue;
    return absl::ResourceExhaustedError(absl::StrCat(
        "a preview of camera '", rig_and_camera, "' is under way; ask again when it ", "is there"));
  }
  if (waiting_.size() >= options_.max_waiting) {
    return absl::ResourceExhaustedError(absl::StrCat(
        waiting_.size(), " previews are under way, which is the limit; ask again in a moment"));
  }
  do {
    ++last_id_;
  } while (last_id_ == 0 || waiting_.contains(last_id_));
  waiting_[last_id_] = {
      .rig_and_camera = rig_and_camera, .registration = registration, .outcome = {}};
  return last_id_;
}

absl::StatusOr<Preview> PreviewBroker::Await(uint32_t id, std::chrono::milliseconds longest,
                                             const std::function<bool()>& is_cancelled) {
  const auto give_up = std::chrono::steady_clock::now() + longest;
  std::unique_lock lock(mutex_);
  Waiting& waiting = waiting_[id];
  absl::StatusOr<Preview> outcome =
      absl::AbortedError(absl::StrCat("the agent of camera '", waiting.rig_and_camera,
                                      "' did not answer within ", longest.count(), " ms"));
  while (!waiting.outcome && std::chrono::steady_clock::now() < give_up) {
    if (is_cancelled()) {
      outcome = absl::CancelledError("nobody waits for the preview any more");
      break;
    }
    const auto look_again = std::chrono::steady_clock::now() + kCancellationInterval;
    changed_.wait_until(lock, std::min(give_up, look_again));
  }
  if (waiting.outcome) outcome = *std::move(waiting.outcome);
  waiting_.erase(id);
  return outcome;
}

absl::StatusOr<PreviewBroker::CameraPreview> PreviewBroker::Get(
    const std::string& rig, const std::string& camera, std::chrono::milliseconds wait,
    const std::function<bool()>& is_cancelled) {
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera", camera));
  if (!rig.empty()) RIGCAL_RETURN_IF_ERROR(ValidateName("rig", rig));
  if (wait.count() <= 0) wait = options_.default_wait;
  if (wait > options_.longest_wait) {
    return absl::InvalidArgumentError(absl::StrCat("max_wait is ", wait.count(), " ms, at most ",
                                                   options_.longest_wait.count(),
                                                   " ms are allowed"));
  }
  RIGCAL_ASSIGN_OR_RETURN(const AgentDirectory::ConnectedCamera connected, Find(rig, camera));
  CameraPreview result{.agent_id = connected.agent_id, .rig = connected.rig, .preview = {}};
  RIGCAL_ASSIGN_OR_RETURN(const uint32_t id, Enter(result.rig, camera, connected.registration));
  connected.link->SendPreviewRequest({.request_id = id,
                                      .camera = camera,
                                      .max_jpeg_bytes = options_.max_jpeg_bytes,
                                      .max_wait_ms = static_cast<uint32_t>(wait.count())});
  RIGCAL_ASSIGN_OR_RETURN(result.preview, Await(id, wait + options_.answer_grace, is_cancelled));
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
  const std::lock_guard lock(mutex_);
  const auto found = waiting_.find(preview.request_id);
  if (found == waiting_.end() || found->second.registration != registration) return;
  if (!found->second.outcome) found->second.outcome = std::move(preview);
  changed_.notify_all();
}

void PreviewBroker::AgentGone(AgentDirectory::Registration registration) {
  const std::lock_guard lock(mutex_);
  for (auto& [id, waiting] : waiting_) {
    if (waiting.registration != registration || waiting.outcome) continue;
    waiting.outcome = absl::AbortedError(absl::StrCat(
        "the agent of camera '", waiting.rig_and_camera, "' disconnected before it answered"));
  }
  changed_.notify_all();
}

void PreviewBroker::Shutdown() {
  const std::lock_guard lock(mutex_);
  shut_down_ = true;
  for (auto& [id, waiting] : waiting_) {
    if (!waiting.outcome) waiting.outcome = absl::UnavailableError("the server is shutting down");
  }
  changed_.notify_all();
}

}  // namespace rigcal::server
