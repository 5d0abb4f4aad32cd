// SPDX-License-Identifier: Apache-2.0
#include "server/session/capture_orders.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>

#include "common/status/status_macros.h"

namespace rigcal::server {

absl::StatusOr<StreamPosition> CaptureOrders::PositionOf(const StreamKey& stream) const {
  StreamPosition position{.stream = stream};
  const absl::StatusOr<StreamStatus> status = store_.GetStream(stream);
  if (absl::IsNotFound(status.status())) {
    position.unknown = true;
    return position;
  }
  RIGCAL_RETURN_IF_ERROR(status.status());
  position.durable_seq = status->durable_seq;
  const uint64_t limit = uint64_t{status->durable_seq} + send_window_;
  position.send_limit_seq = static_cast<uint32_t>(std::min<uint64_t>(limit, UINT32_MAX));
  return position;
}

std::vector<CaptureOrder> CaptureOrders::ToStart(const Session& session,
                                                 ConnectedCameras connected) const {
  std::map<std::string, CaptureOrder> by_agent;
  for (const AgentDirectory::ConnectedCamera& camera : connected) {
    const std::string& name = camera.camera.description.camera;
    const SessionCamera* own = session.FindCamera(name);
    if (own == nullptr || own->agent_id != camera.agent_id) continue;
    CaptureOrder& order = by_agent[camera.agent_id];
    order.link = camera.link;
    order.command.session_id = session.id;
    order.command.target = session.target;
    order.command.cameras.push_back({.stream = {session.id, name, camera.camera.stream_epoch},
                                     .durable_seq = 0,
                                     .send_limit_seq = send_window_,
                                     .unknown = false});
  }
  std::vector<CaptureOrder> orders;
  for (auto& [agent_id, order] : by_agent) orders.push_back(std::move(order));
  return orders;
}

absl::StatusOr<std::vector<CaptureOrder>> CaptureOrders::ToResume(
    const Session& session, ConnectedCameras connected) const {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<SessionCameraCounts> counts,
                          store_.GetSessionCounts(session.id));
  const auto has_ended = [&](const StreamPosition& position) {
    const auto count =
        std::ranges::find(counts, position.stream.camera, &SessionCameraCounts::camera);
    if (count == counts.end()) return false;
    return count->ended() || std::ranges::any_of(count->streams, [&](const StreamStatus& stream) {
             return stream.stream_epoch == position.stream.stream_epoch && stream.ended();
           });
  };
  std::vector<CaptureOrder> orders = ToStart(session, connected);
  for (CaptureOrder& order : orders) {
    std::erase_if(order.command.cameras, has_ended);
    for (StreamPosition& position : order.command.cameras) {
      RIGCAL_ASSIGN_OR_RETURN(position, PositionOf(position.stream));
    }
  }
  std::erase_if(orders, [](const CaptureOrder& order) { return order.command.cameras.empty(); });
  return orders;
}

}  // namespace rigcal::server
