// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/session/session.h"
#include "server/session/agent_directory.h"
#include "server/session/agent_link.h"
#include "server/store/store.h"

namespace rigcal::server {

// The command for one agent, and the link to send it over.
struct CaptureOrder {
  std::shared_ptr<AgentLink> link;
  StartCaptureCommand command;
};

// Makes the commands that start captures: which agent captures with which of its cameras, and from
// which observation on. Sends nothing. Thread-safe.
class CaptureOrders {
 public:
  using ConnectedCameras = absl::Span<const AgentDirectory::ConnectedCamera>;

  // `store` must outlive this object. `send_window`: rows an agent may have unacknowledged.
  CaptureOrders(const Store* store, uint32_t send_window)
      : store_(*store), send_window_(send_window) {}

  // How much of a stream is stored; `unknown` where the store has no such session or camera.
  absl::StatusOr<StreamPosition> PositionOf(const StreamKey& stream) const;
  // One order for each agent that has cameras of `session` among `connected`, for a session without
  // observations. A camera that takes part with another agent is left out.
  std::vector<CaptureOrder> ToStart(const Session& session, ConnectedCameras connected) const;
  // The same from the stored positions on, without the cameras that have ended: these must not
  // begin their recording again.
  absl::StatusOr<std::vector<CaptureOrder>> ToResume(const Session& session,
                                                     ConnectedCameras connected) const;

 private:
  const Store& store_;
  const uint32_t send_window_;
};

}  // namespace rigcal::server
