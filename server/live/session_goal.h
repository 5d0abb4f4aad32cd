// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "common/session/session.h"
#include "server/live/live_state.h"

namespace rigcal::server {

// Whether a session that has captured for `elapsed_s` may end by its goal: the expected error is
// below the target in 95 % of the waved volume, held-out data agree, the scale is known, every
// camera of the session has a part in the estimate, and the estimate is of the last 10 s. Counts of
// views alone never end a session.
LiveGoal JudgeGoal(const SessionGoal& goal, const Session& session, const LiveEstimate* estimate,
                   double elapsed_s, int64_t now_utc_ns);

// For Session::stop_reason: "the expected error is 0.46 mm, below 0.5 mm".
std::string StopReason(const LiveGoal& goal);

}  // namespace rigcal::server
