// SPDX-License-Identifier: Apache-2.0
#include "server/session/stream_opening.h"

#include <algorithm>

#include "common/status/status_macros.h"

namespace rigcal::server {

std::vector<StreamKey> StreamsOf(const std::vector<CaptureOrder>& orders) {
  std::vector<StreamKey> streams;
  for (const CaptureOrder& order : orders) {
    for (const StreamPosition& position : order.command.cameras) {
      if (!position.unknown) streams.push_back(position.stream);
    }
  }
  return streams;
}

absl::Status OpenStreams(const std::vector<StreamKey>& streams, Store* store) {
  if (streams.empty()) return absl::OkStatus();
  std::vector<Delivery> deliveries(streams.size());
  for (size_t i = 0; i < streams.size(); ++i) {
    deliveries[i].batch.stream = streams[i];
    deliveries[i].opens_stream = true;
  }
  return store->Append(deliveries).status();
}

absl::Status EndStreamsNeverBegun(const Session& session, const AgentRecord& agent,
                                  const AgentDirectory& directory, Store* store) {
  if (!agent.spool_survives_restart) return absl::OkStatus();
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionCameraCounts> counts,
                          store->GetSessionCounts(session.id));
  std::vector<Delivery> deliveries;
  for (const SessionCameraCounts& camera : counts) {
    const SessionCamera* const own = session.FindCamera(camera.camera);
    // A camera that is not there any more is missing, not ended.
    const bool announced = std::ranges::any_of(agent.cameras, [&](const AnnouncedCamera& one) {
      return one.description.camera == camera.camera;
    });
    if (own == nullptr || own->agent_id != agent.agent_id || !announced) continue;
    for (const StreamStatus& status : camera.streams) {
      const StreamKey stream{session.id, camera.camera, status.stream_epoch};
      if (status.last_seq || status.durable_seq > 0 || status.reported_seq > 0 ||
          directory.HolderOf(agent.agent_id, stream) != StreamHolder::kGone) {
        continue;
      }
      Delivery& delivery = deliveries.emplace_back();
      delivery.batch.stream = stream;
      delivery.last_seq = 0;
    }
  }
  return deliveries.empty() ? absl::OkStatus() : store->Append(deliveries).status();
}

}  // namespace rigcal::server
