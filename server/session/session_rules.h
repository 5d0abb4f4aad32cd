// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "common/session/session.h"
#include "server/session/agent_directory.h"

namespace rigcal::server {

// Checks a new session: names, target, cameras described by hand, goal. INVALID_ARGUMENT
// lists every fault. RESOURCE_EXHAUSTED: more than `max_cameras` cameras.
absl::Status ValidateNewSession(const Session& session, size_t max_cameras);

// The cameras that take part in `session` from its start on, sorted by name: those described by
// hand, and of `connected` (cameras of the session's rig with a live agent) the requested ones, or
// all of them when neither was asked for.
//   FAILED_PRECONDITION  no camera at all, or a requested one is not connected (all are named)
//   RESOURCE_EXHAUSTED   more than `max_cameras` cameras
absl::StatusOr<std::vector<SessionCamera>> ChooseCameras(
    const Session& session, absl::Span<const AgentDirectory::ConnectedCamera> connected,
    size_t max_cameras);

// FAILED_PRECONDITION when a camera of `starting` captures for one of `active` already; names both.
absl::Status CheckNotCapturing(const Session& starting, absl::Span<const Session> active);

// FAILED_PRECONDITION: it has been started before, or thrown away.
absl::Status CheckMayStart(const Session& session);

// FAILED_PRECONDITION: it has not been started.
absl::Status CheckMayStop(const Session& session);

// FAILED_PRECONDITION when it captures or drains. `action` is for the message: "deleted".
absl::Status CheckNotRunning(const Session& session, std::string_view action);

// FAILED_PRECONDITION: it was thrown away; the message says how to take that back.
absl::Status CheckNotDiscarded(const Session& session);

// Checks that `session` can go on with `earlier`. FAILED_PRECONDITION: that one has not finished,
// its observations were deleted, it was thrown away, or it has another rig or target.
absl::Status CheckContinues(const Session& session, const Session& earlier);

// The session's cameras that have not delivered everything yet, in its order.
std::vector<std::string> CamerasNotEnded(const Session& session,
                                         absl::Span<const SessionCameraCounts> counts);

// For messages: "capturing since 2026-01-02 03:04:05 UTC".
std::string StateSince(const Session& session);

// The drain time: as asked for, or the default for 0. INVALID_ARGUMENT: negative, not finite
// or above the limit of 600 s.
absl::StatusOr<double> DrainTimeout(double asked_s);

}  // namespace rigcal::server
