// SPDX-License-Identifier: Apache-2.0
#include "server/session/capture_sender.h"

#include <spdlog/spdlog.h>

#include <optional>

namespace rigcal::server {

void CaptureSender::SendStart(const Session& session, std::vector<CaptureOrder> orders) {
  const bool draining = session.state == SessionState::kDraining;
  for (CaptureOrder& order : orders) {
    tasks_.Post([link = std::move(order.link), command = std::move(order.command), draining] {
      link->SendStartCapture(command);
      if (draining) link->SendStopCapture(command.session_id);
    });
  }
}

void CaptureSender::SendStop(const Session& session) {
  std::set<std::string> told;
  for (const AgentDirectory::ConnectedCamera& camera : directory_.ConnectedCameras(session.rig)) {
    const SessionCamera* own = session.FindCamera(camera.camera.description.camera);
    if (own == nullptr || own->agent_id != camera.agent_id) continue;
    if (!told.insert(camera.agent_id).second) continue;
    tasks_.Post(
        [link = camera.link, session_id = session.id] { link->SendStopCapture(session_id); });
  }
}

void CaptureSender::SendLateStop(const StreamKey& stream) {
  tasks_.Post([this, stream] { StopLateCapture(stream); });
}

void CaptureSender::StopLateCapture(const StreamKey& stream) {
  const std::optional<StreamContextCache::Owner> owner = contexts_.FindOwner(stream);
  if (!owner) return;
  for (const AgentDirectory::ConnectedCamera& camera : directory_.ConnectedCameras(owner->rig)) {
    if (camera.camera.description.camera != stream.camera || camera.agent_id != owner->agent_id) {
      continue;
    }
    {
      std::lock_guard lock(mutex_);
      if (!late_stops_.emplace(camera.registration, stream.session_id).second) return;
    }
    spdlog::info("session {}: agent {} still captures for it; sending it the stop command",
                 stream.session_id, owner->agent_id);
    camera.link->SendStopCapture(stream.session_id);
  }
}

void CaptureSender::Forget(AgentDirectory::Registration registration) {
  std::lock_guard lock(mutex_);
  std::erase_if(late_stops_, [&](const auto& sent) { return sent.first == registration; });
}

}  // namespace rigcal::server
