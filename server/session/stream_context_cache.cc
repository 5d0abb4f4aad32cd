// SPDX-License-Identifier: Apache-2.0
#include "server/session/stream_context_cache.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace rigcal::server {
namespace {

absl::Status NoSuchSession(std::string_view id) {
  return absl::NotFoundError(
      absl::StrCat("there is no session '", std::string(id), "'; it may have been deleted"));
}

}  // namespace

void StreamContextCache::Put(const Session& session) {
  Entry entry{.rig = session.rig,
              .state = session.state,
              .marker_count = session.target.marker_count(),
              .cameras = {},
              .reader_count = 0};
  for (const SessionCamera& camera : session.cameras) {
    entry.cameras[camera.description.camera] = {camera.description.image_size_px, camera.agent_id};
  }
  std::lock_guard lock(mutex_);
  Entry& place = sessions_[session.id];
  entry.reader_count = place.reader_count;
  place = std::move(entry);
}

size_t StreamContextCache::size() const {
  std::lock_guard lock(mutex_);
  return sessions_.size();
}

absl::StatusOr<StreamContext> StreamContextCache::GetStreamContext(const StreamKey& stream) const {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(stream.session_id);
  if (session == sessions_.end()) return NoSuchSession(stream.session_id);
  if (session->second.state == SessionState::kCreated) {
    return absl::FailedPreconditionError(absl::StrCat("session '", stream.session_id,
                                                      "' takes no observations of camera '",
                                                      stream.camera, "': it has not been started"));
  }
  const auto camera = session->second.cameras.find(stream.camera);
  if (camera == session->second.cameras.end()) {
    return absl::NotFoundError(absl::StrCat("session '", stream.session_id, "' has no camera '",
                                            stream.camera,
                                            "'; its cameras were fixed at its "
                                            "start"));
  }
  return StreamContext{camera->second.image_size_px, session->second.marker_count};
}

absl::Status StreamContextCache::CheckAgent(const StreamKey& stream, std::string_view agent_id,
                                            std::string_view rig) const {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(stream.session_id);
  if (session == sessions_.end()) return absl::OkStatus();
  if (!rig.empty() && session->second.rig != rig) {
    return absl::PermissionDeniedError(
        absl::StrCat("agent '", std::string(agent_id), "' of rig '", std::string(rig),
                     "' must not deliver camera '", stream.camera, "' to session '",
                     stream.session_id, "': it is of rig '", session->second.rig, "'"));
  }
  const auto camera = session->second.cameras.find(stream.camera);
  if (camera == session->second.cameras.end() || camera->second.agent_id == agent_id) {
    return absl::OkStatus();
  }
  const std::string owner =
      camera->second.agent_id.empty()
          ? "was described by hand and has no agent"
          : absl::StrCat("takes part with agent '", camera->second.agent_id, "'");
  const std::string caller = agent_id.empty() ? "a caller that is no agent"
                                              : absl::StrCat("agent '", std::string(agent_id), "'");
  return absl::PermissionDeniedError(
      absl::StrCat(caller, " must not deliver camera '", stream.camera, "' to session '",
                   stream.session_id, "': there the camera ", owner));
}

std::optional<StreamContextCache::Owner> StreamContextCache::FindOwner(
    const StreamKey& stream) const {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(stream.session_id);
  if (session == sessions_.end()) return std::nullopt;
  const auto camera = session->second.cameras.find(stream.camera);
  if (camera == session->second.cameras.end() || camera->second.agent_id.empty()) {
    return std::nullopt;
  }
  return Owner{session->second.rig, camera->second.agent_id};
}

absl::Status StreamContextCache::AddReader(std::string_view session_id) {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(session_id);
  if (session == sessions_.end()) return NoSuchSession(session_id);
  ++session->second.reader_count;
  return absl::OkStatus();
}

void StreamContextCache::RemoveReader(std::string_view session_id) {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(session_id);
  if (session != sessions_.end()) --session->second.reader_count;
}

absl::Status StreamContextCache::Remove(std::string_view session_id) {
  std::lock_guard lock(mutex_);
  const auto session = sessions_.find(session_id);
  if (session == sessions_.end()) return NoSuchSession(session_id);
  if (session->second.reader_count > 0) {
    return absl::FailedPreconditionError(absl::StrCat(
        "session '", std::string(session_id),
        "' is being read, by a calibration or a client; wait for its end, or cancel it"));
  }
  sessions_.erase(session);
  return absl::OkStatus();
}

}  // namespace rigcal::server
