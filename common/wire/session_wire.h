// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/session/session.h"
#include "rigcal/v1/session.pb.h"
#include "rigcal/v1/session_service.pb.h"

namespace rigcal::wire {

// `counts` as from the store (may be empty); `connected_cameras` are names with a live agent.
v1::Session ToProto(const Session& session, const std::vector<SessionCameraCounts>& counts,
                    const std::vector<std::string>& connected_cameras);
v1::Session ToProto(const SessionSummary& summary);
// What CreateSession asks for: id, rig ("rig" when empty), title, target, requested cameras and
// cameras by hand, goal, and what it continues. Names, the title, numbers of cameras and the values
// of the goal are not looked at.
absl::StatusOr<Session> FromProto(const v1::CreateSessionRequest& proto);

// The store's form of a session (without counts); ParseSession(SerializeSession(s)) == s.
std::string SerializeSession(const Session& session);
absl::StatusOr<Session> ParseSession(std::string_view bytes);

}  // namespace rigcal::wire
